// What the catalog's doors refuse, for every row of it: settings, tables and units that are none of the algorithm's, each with a
// message that says what is wrong.

#include <gtest/gtest.h>

#include <set>

#include "tests/support/table_render.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using Parameters = std::map<std::string, std::string>;

bool mentions(const Status& status, std::string_view what) { return status.message().find(what) != std::string::npos; }

RenderSettings small_settings(const AlgorithmInfo& row) {
    const std::string name(row.name);
    return testing::settings_of(name, testing::with_all_learned(name, {}));
}

TEST(Catalog, RowsAreComplete) {
    std::set<std::string_view> names;
    for (const AlgorithmInfo* row : catalog()) {
        EXPECT_TRUE(names.insert(row->name).second) << row->name << " twice";
        EXPECT_FALSE(row->summary.empty() || row->source.empty() || row->bias.empty()) << row->name;
        ASSERT_NE(row->make, nullptr) << row->name;
        EXPECT_EQ(*find_algorithm(row->name), row);
        std::set<std::string_view> parameters;
        for (const ParameterInfo& p : row->parameters) {
            EXPECT_TRUE(parameters.insert(p.name).second) << row->name << " has " << p.name << " twice";
            for (const double v : {p.default_value.at_first, p.default_value.later})
                EXPECT_TRUE(p.min_value <= v && v <= p.max_value) << row->name << " " << p.name;
            EXPECT_TRUE(p.by_depth || p.default_value.at_first == p.default_value.later) << row->name << " " << p.name;
            EXPECT_FALSE(p.by_depth && !p.choices.empty()) << row->name << " " << p.name;
            EXPECT_FALSE(p.help.empty()) << row->name << " " << p.name;
            if (!p.choices.empty()) {
                EXPECT_TRUE(p.integer && p.min_value == 0 && p.max_value + 1 == double(p.choices.size()))
                    << row->name << " " << p.name;
            }
        }
        // Without camera samples all light is in splats.
        EXPECT_TRUE(row->camera_samples || row->light_paths_per_pixel) << row->name;
        if (row->learning) {
            EXPECT_FALSE(row->learning->parts.empty()) << row->name;
            const LearningPlan plan = row->learning->plan(small_settings(*row).algorithm);
            ASSERT_FALSE(plan.rounds.empty()) << row->name;
            EXPECT_EQ(plan.first_sample(plan.rounds.size()), plan.samples) << row->name;
            EXPECT_FALSE(plan.rounds[0].guided) << row->name;
        }
    }
}

/// The row of dummy_algorithm.cpp, which nothing else in this program names, is one like any other.
TEST(Catalog, HasTheRowOfAFileThatIsLinked) {
    ASSERT_TRUE(find_algorithm("dummy").ok());
    const auto settings = AlgorithmSettings::parse("dummy", {{"trust", "2.5"}});
    ASSERT_TRUE(settings.ok());
    EXPECT_EQ(settings->value("trust"), 2.5);
    const auto scene = testing::diffuse_box();
    TrainingReport report;
    const auto tables = make_tables(*scene, {*settings}, {}, &report);
    ASSERT_TRUE(tables.ok());
    const std::string bytes = serialize(*tables);
    const auto again = parse_tables(bytes, settings->info().learning->parts);
    ASSERT_TRUE(again.ok()) << again.status().message();
    EXPECT_EQ(serialize(*again), bytes);
    EXPECT_TRUE(Renderer::create(scene, {*settings}, *again).ok());
    std::string negative = bytes;
    negative[negative.size() - 2] = char(0xbf);  // the sign of the number, whose digest is wrong then as well
    EXPECT_EQ(parse_tables(negative, settings->info().learning->parts).status().code(), StatusCode::kDataLoss);
}

TEST(Settings, UnknownAlgorithmsAreRefusedWithTheKnownNames) {
    for (const char* name : {"no-such", "", "Path", "path ", "bdpt\n"}) {
        const Status refused = AlgorithmSettings::parse(name, {}).status();
        EXPECT_EQ(refused.code(), StatusCode::kInvalidArgument) << name;
        EXPECT_TRUE(mentions(refused, "'" + std::string(name) + "'")) << refused.message();
        for (const AlgorithmInfo* row : catalog()) EXPECT_TRUE(mentions(refused, row->name)) << refused.message();
        EXPECT_EQ(find_algorithm(name).status().code(), StatusCode::kNotFound) << name;
    }
}

TEST(Settings, ParametersOfOtherAlgorithmsAreRefused) {
    for (const AlgorithmInfo* row : catalog()) {
        const std::string name(row->name);
        std::set<std::string> others{"no-such", ""};
        for (const AlgorithmInfo* other : catalog())
            for (const ParameterInfo& p : other->parameters)
                if (!small_settings(*row).algorithm.has(p.name)) others.insert(std::string(p.name));
        for (const std::string& parameter : others) {
            const Status refused = AlgorithmSettings::parse(name, {{parameter, "1"}}).status();
            EXPECT_EQ(refused.code(), StatusCode::kInvalidArgument) << name << " " << parameter;
            EXPECT_TRUE(mentions(refused, "'" + name + "' has no parameter '" + parameter + "'")) << refused.message();
        }
    }
}

TEST(Settings, BadValuesAreRefusedByNameAndRange) {
    for (const AlgorithmInfo* row : catalog()) {
        const std::string name(row->name);
        for (const ParameterInfo& p : row->parameters) {
            std::vector<std::string> bad{"",     "x",     "1x",  " 1",  "1 ",  "nan",   "inf",
                                         "-inf", "1e999", "--1", "0x1", "1;5", "1e400", "on off"};
            const std::string good = p.text_of(p.max_value), low = std::to_string(p.min_value - 1);
            for (const std::string& later : {std::string(), std::string("x"), " " + good, low, good + ",", good + "," + good})
                bad.push_back(good + "," + later);
            bad.insert(bad.end(), {"," + good, low + "," + good, ","});
            if (!p.by_depth) bad.push_back(good + "," + good);
            bad.push_back(std::to_string(p.min_value - 1));
            bad.push_back(std::to_string(p.max_value * 2 + 1));
            if (p.integer) bad.push_back(std::to_string(p.min_value + 0.5));
            for (const std::string& value : bad) {
                const Status refused = AlgorithmSettings::parse(name, {{std::string(p.name), value}}).status();
                EXPECT_EQ(refused.code(), StatusCode::kInvalidArgument) << name << " " << p.name << "=" << value;
                EXPECT_TRUE(mentions(refused, p.name) && mentions(refused, name)) << refused.message();
                for (const std::string_view choice : p.choices) EXPECT_TRUE(mentions(refused, choice)) << refused.message();
            }
            // What is in range comes back as the same text.
            std::vector<ByDepth<double>> values{p.min_value, p.default_value, p.max_value};
            if (p.by_depth) values.insert(values.end(), {{p.min_value, p.max_value}, {p.max_value, p.min_value}});
            for (const ByDepth<double>& value : values) {
                const auto settings = AlgorithmSettings(small_settings(*row).algorithm).with(p.name, value);
                const auto again = AlgorithmSettings::parse(name, settings.text());
                ASSERT_TRUE(again.ok()) << again.status().message();
                EXPECT_EQ(*again, settings.completed()) << name << " " << p.name;
            }
            for (size_t c = 0; c < p.choices.size(); ++c)
                EXPECT_EQ(AlgorithmSettings::parse(name, {{std::string(p.name), std::string(p.choices[c])}})->value(p.name),
                          double(c));
        }
    }
}

/// People are shown names; what digests and the wire read has numbers, and parse() takes both back.
TEST(Settings, ChoicesHaveNamesForPeopleAndNumbersForDigests) {
    const auto settings = AlgorithmSettings::parse("spcbpt", {{"heuristic", "power"}, {"trainer", "1"}, {"ris-aware", "on"}});
    ASSERT_TRUE(settings.ok()) << settings.status().message();
    const std::map<std::string, std::string> named{{"heuristic", "power"}, {"trainer", "adam"}, {"ris-aware", "on"}};
    const std::map<std::string, std::string> numbers{{"heuristic", "1"}, {"trainer", "1"}, {"ris-aware", "1"}};
    EXPECT_EQ(settings->chosen_named_text(), named);
    EXPECT_EQ(settings->chosen_text(), numbers);
    EXPECT_EQ(settings->named_text().at("ris-aware"), "on");
    EXPECT_EQ(settings->named_text().at("training-paths"), "500000");
    EXPECT_EQ(settings->named_text().at("mix"), "0.1");
    for (const AlgorithmInfo* row : catalog()) {
        AlgorithmSettings all = small_settings(*row).algorithm;
        for (const ParameterInfo& p : row->parameters) all = all.with(p.name, p.max_value);
        const auto again = AlgorithmSettings::parse(row->name, all.named_text());
        ASSERT_TRUE(again.ok()) << again.status().message();
        EXPECT_EQ(*again, all.completed()) << row->name;
    }
}

/// Two numbers that are equal are one, so that a setting has one text and one digest.
TEST(Settings, NumbersByDepthAreOneOrTwo) {
    const auto connections = [](const std::string& text) { return AlgorithmSettings::parse("spcbpt", {{"connections", text}}); };
    EXPECT_EQ(connections("5,2")->value_by_depth("connections"), ByDepth<double>(5, 2));
    EXPECT_EQ(connections("3")->value_by_depth("connections"), ByDepth<double>(3, 3));
    EXPECT_EQ(*connections("3"), *connections("3,3"));
    EXPECT_NE(*connections("5,2"), *connections("2,5"));
    for (const auto& [text, canonical] :
         {std::pair{"5,2", "5,2"}, {"4,4", "4"}, {"64", "64"}, {"1,64", "1,64"}, {"6e1,2", "60,2"}}) {
        EXPECT_EQ(connections(text)->chosen_text().at("connections"), canonical);
        EXPECT_EQ(connections(text)->chosen_named_text().at("connections"), canonical);
    }
    for (const char* bad : {"5,2,1", "5,", ",2", ",", "0,2", "5,0", "65", "65,2", "5,65", "5, 2", "5;2", "2.5,1", "5,x", ""})
        EXPECT_EQ(connections(bad).status().message(),
                  "parameter connections=" + std::string(bad) +
                      " of 'spcbpt' must be an integer from 1 to 64, or two with a comma between them: at the camera's first "
                      "hit, at later ones");
    EXPECT_EQ(AlgorithmSettings::parse("spcbpt", {{"windows", "5,2"}}).status().message(),
              "parameter windows=5,2 of 'spcbpt' must be an integer from 1 to 32");
}

TEST(Settings, RefusalsSuggestWhatIsNear) {
    const auto refusal = [](std::string_view name, const Parameters& parameters) {
        return AlgorithmSettings::parse(name, parameters).status().message();
    };
    EXPECT_TRUE(refusal("bpdt", {}).starts_with("no algorithm named 'bpdt' (did you mean 'bdpt'?); choose one of: path, "));
    EXPECT_EQ(refusal("bdpt", {{"heuristics", "power"}}),
              "algorithm 'bdpt' has no parameter 'heuristics' (did you mean 'heuristic'?); `lightloom algorithms bdpt` lists them");
    EXPECT_EQ(
        refusal("bdpt", {{"heuristic", "powr"}}),
        "parameter heuristic=powr of 'bdpt' must be balance, power, maximum, popov or correlation-aware (did you mean 'power'?)");
    EXPECT_EQ(refusal("path", {{"heuristic", "3"}}), "parameter heuristic=3 of 'path' must be balance, power or maximum");
    EXPECT_EQ(refusal("lvcbpt", {{"heuristic", "vcm+"}}),
              "parameter heuristic=vcm+ of 'lvcbpt' must be balance, power, maximum, popov or correlation-aware");
    EXPECT_EQ(refusal("spcbpt", {{"ris-aware", "yes"}}), "parameter ris-aware=yes of 'spcbpt' must be off or on");
    EXPECT_EQ(refusal("bdpt", {{"rr-start", "1"}}), "parameter rr-start=1 of 'bdpt' must be an integer from 2 to 256");
}

TEST(Settings, DepthsOutOfRangeAreRefused) {
    const auto scene = testing::diffuse_box();
    for (const AlgorithmInfo* row : catalog()) {
        RenderSettings settings = small_settings(*row);
        const Tables tables = testing::random_tables_for(*row, *scene, 1);
        for (const int depth : {-1, kMaxEdges, kMaxEdges + 1}) {
            settings.max_depth = depth;
            const Status refused = Renderer::create(scene, settings, tables).status();
            EXPECT_EQ(refused.code(), StatusCode::kInvalidArgument) << row->name << " " << depth;
            EXPECT_TRUE(mentions(refused, "max depth")) << refused.message();
        }
        settings.max_depth = kMaxEdges - 1;
        EXPECT_TRUE(Renderer::create(scene, settings, tables).ok()) << row->name;
    }
}

/// Whether two rows read the same parts.
/// Whether the tables of `b` have no part that `a` does not read.
bool reads_parts(const AlgorithmInfo& a, const AlgorithmInfo& b) {
    const auto known = a.learning->parts, parts = b.learning->parts;
    return std::all_of(parts.begin(), parts.end(),
                       [&](const TablePart* p) { return std::find(known.begin(), known.end(), p) != known.end(); });
}

TEST(TablesOfAlgorithms, AreRefusedByOthers) {
    const auto scene = testing::diffuse_box();
    int pairs = 0;
    for (const AlgorithmInfo* row : catalog()) {
        if (!row->learning) continue;
        const RenderSettings settings = small_settings(*row);
        const Status missing = Renderer::create(scene, settings).status();
        EXPECT_EQ(missing.code(), StatusCode::kFailedPrecondition) << row->name;
        EXPECT_TRUE(mentions(missing, "needs its tables") && mentions(missing, row->name)) << missing.message();
        EXPECT_TRUE(Renderer::create(scene, settings, testing::random_tables_for(*row, *scene, 1)).ok()) << row->name;
        for (const AlgorithmInfo* other : catalog()) {
            if (!other->learning || other == row) continue;
            ++pairs;
            const Tables tables = testing::random_tables_for(*other, *scene, 1);
            const Status refused = Renderer::create(scene, settings, tables).status();
            EXPECT_EQ(refused.code(), StatusCode::kFailedPrecondition) << row->name << " with tables of " << other->name;
            EXPECT_TRUE(mentions(refused, "not those of") && mentions(refused, row->name)) << refused.message();
            if (reads_parts(*row, *other)) continue;  // they can be read, and say whose they are
            const Status unread = parse_tables(serialize(tables), row->learning->parts).status();
            EXPECT_EQ(unread.code(), StatusCode::kFailedPrecondition) << row->name << " with tables of " << other->name;
        }
    }
    EXPECT_GE(pairs, 6);
}

/// Tables of a scene with other lights.
TEST(TablesOfAlgorithms, OfOtherScenesAreRefused) {
    const auto scene = testing::diffuse_box(), other = testing::delta_lights();
    int rows = 0;
    for (const AlgorithmInfo* row : catalog()) {
        const Tables tables = testing::random_tables_for(*row, *other, 1);
        if (!tables.get<SubspaceTables>()) continue;
        ++rows;
        EXPECT_EQ(Renderer::create(scene, small_settings(*row), tables).status().code(), StatusCode::kDataLoss) << row->name;
    }
    EXPECT_GE(rows, 2);
}

TEST(Units, OfTheWrongShapeAreRefused) {
    const auto scene = testing::diffuse_box();
    int whole = 0, splats = 0;
    for (const AlgorithmInfo* row : catalog()) {
        const RenderSettings settings = small_settings(*row);
        const auto renderer = Renderer::create(scene, settings, testing::random_tables_for(*row, *scene, 1));
        ASSERT_TRUE(renderer.ok()) << row->name;
        const RenderUnit good = testing::whole_frame(*scene, settings.algorithm, 1);
        ASSERT_TRUE((*renderer)->render(good, {}).ok()) << row->name;
        const auto refused = [&](const RenderUnit& unit, std::string_view why) {
            for (const Status& status :
                 {(*renderer)->render(unit, {}).status(), (*renderer)->watch(unit, [](const SeenContribution&) {}, {}).status()}) {
                EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << row->name << ": " << why;
                EXPECT_TRUE(mentions(status, why) && mentions(status, "'" + std::string(row->name) + "'")) << status.message();
            }
        };
        RenderUnit unit = good;
        unit.splats_only = !unit.splats_only;
        refused(unit, row->camera_samples ? "makes camera samples" : "only splats");
        splats += !row->camera_samples;
        unit = good;
        unit.tile = {0, 0, 8, 8};
        if (row->frame == FrameShape::kWhole) {
            refused(unit, "units of the whole frame");
            ++whole;
        } else {
            EXPECT_TRUE((*renderer)->render(unit, {}).ok()) << row->name;
        }
        unit = good;
        unit.light_path_count = 1;
        if (!row->light_paths_per_pixel) refused(unit, "traces no light paths");
    }
    EXPECT_GE(whole, 2);
    EXPECT_GE(splats, 1);
}

/// Mutation: bdpt without its reason says only that there is no such parameter.
TEST(Catalog, AParameterThatMakesNoSenseIsRefusedWithTheReason) {
    EXPECT_EQ(AlgorithmSettings::parse("bdpt", {{"connections", "4"}}).status().message(),
              "algorithm 'bdpt' has no parameter 'connections': every camera vertex is connected to all vertices of the one light "
              "sub-path of its sample; vcm connects to several");
    for (const AlgorithmInfo* row : catalog())
        for (const AbsentParameter& absent : row->absent)
            for (const ParameterInfo& p : row->parameters) EXPECT_NE(p.name, absent.name) << row->name;
    EXPECT_EQ(AlgorithmSettings::parse("path", {{"shadow-rays", "1025"}}).status().message(),
              "parameter shadow-rays=1025 of 'path' must be an integer from 1 to 1024");
}

}  // namespace
}  // namespace lightloom
