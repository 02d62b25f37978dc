// How help is laid out.

#include "common/cli/help.h"

#include <gtest/gtest.h>

#include <memory>
#include <sstream>

namespace lightloom {
namespace {

TEST(Wrapped, BreaksAtSpacesAndKeepsLongWords) {
    EXPECT_EQ(wrapped("one two", 2), "  one two\n");
    EXPECT_EQ(wrapped("", 2), "\n");
    const std::string word(30, 'x'), long_word(120, 'y'), indent(9, ' ');
    EXPECT_EQ(wrapped(word + " " + word + " " + word, 9), indent + word + " " + word + "\n" + indent + word + "\n")
        << "101 columns";
    EXPECT_EQ(wrapped("a " + long_word + " b", 4), "    a\n    " + long_word + "\n    b\n");
}

TEST(HelpFormatter, KeepsOptionsAndCommandsWithinTheWidth) {
    CLI::App app{"A program.", "program"};
    app.formatter(std::make_shared<HelpFormatter>());
    std::string text, description;
    for (int i = 0; i < 60; ++i) description += "words ";
    app.add_option("--short", text, "Short");
    app.add_option("--long", text, description);
    app.add_option("--with-a-name-that-leaves-no-room-beside-it", text, description);
    app.add_subcommand("command", description);
    const std::string help = app.help();
    std::istringstream lines(help);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), kHelpWidth) << line;
    EXPECT_NE(help.find("  --short TEXT                Short\n"), std::string::npos) << help;
    EXPECT_NE(help.find("  --long TEXT                 words words"), std::string::npos) << help;
    EXPECT_NE(help.find("beside-it TEXT\n                              words"), std::string::npos) << help;
    EXPECT_NE(help.find("  command                     words"), std::string::npos) << help;
}

}  // namespace
}  // namespace lightloom
