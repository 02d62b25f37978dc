// Texts of others in a table on a terminal.

#include "client/text_table.h"

#include <gtest/gtest.h>

#include "common/core/utf8.h"

namespace lightloom::client {
namespace {

TEST(OneLine, IsWhatATerminalShowsAsItIs) {
    for (const char* good : {"", "caf\xc3\xa9", "\xe6\xbc\xa2\xe5\xad\x97", "\xf0\x9f\x8e\xa8",
                             "a\xc2\xa0"
                             "b"}) {
        EXPECT_TRUE(is_one_line(good)) << good;
        EXPECT_EQ(one_line(good), good);
    }
    EXPECT_EQ(one_line("\x1b[31m"), "\\x1b[31m");
    EXPECT_EQ(one_line("a\nb\tc\x7f"), "a\\x0ab\\x09c\\x7f");
    EXPECT_EQ(one_line("\xc2\x9b"
                       "1m"),
              "\\x9b1m")
        << "of eight bits";
    EXPECT_EQ(one_line("\xe2\x80\xae"
                       "gpj.\xe2\x80\xac"),
              "\\u202egpj.\\u202c")
        << "from right to left";
    EXPECT_EQ(one_line("\xe2\x80\xa8\xe2\x81\xa6"), "\\u2028\\u2066");
    EXPECT_EQ(one_line("caf\xe9"), "caf\xef\xbf\xbd");
    for (const char* bad : {"\x1b", "\n", "\xc2\x80", "\xe2\x80\x8f", "\xd8\x9c", "\xe2\x81\xa9", "\xe9"}) {
        EXPECT_FALSE(is_one_line(bad)) << one_line(bad);
        EXPECT_TRUE(is_one_line(one_line(bad)));
    }
}

TEST(Characters, AreCountedAndCutWhole) {
    const std::string text = "a\xc3\xa4\xe2\x82\xac\xf0\x9f\x8e\xa8z";
    EXPECT_EQ(character_count(text), 5u);
    EXPECT_EQ(first_characters(text, 2), "a\xc3\xa4");
    EXPECT_EQ(first_characters(text, 0), "");
    EXPECT_EQ(first_characters(text, 9), text);
    EXPECT_EQ(last_characters(text, 2), "\xf0\x9f\x8e\xa8z");
    EXPECT_EQ(last_characters(text, 5), text);
}

TEST(TextTable, HasColumnsAsWideAsTheirCells) {
    EXPECT_EQ(text_table({{"A", "LONG", "C"}, {"\xc3\xa4\xc3\xa4\xc3\xa4", "b", ""}, {"x", "", "y"}}),
              "A    LONG  C\n\xc3\xa4\xc3\xa4\xc3\xa4  b\nx          y\n");
    EXPECT_EQ(cell("", 5), "-");
    EXPECT_EQ(cell("12345", 5), "12345");
    EXPECT_EQ(cell("123456", 5), "1234\xe2\x80\xa6");
    EXPECT_EQ(path_cell("rooms/a.pbrt", 7),
              "\xe2\x80\xa6"
              "a.pbrt");
    EXPECT_EQ(cell("a\nb", 9), "a\\x0ab");
}

}  // namespace
}  // namespace lightloom::client
