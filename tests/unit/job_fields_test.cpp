// The one list of a job's fields against everything that enumerates them. A member of JobSpec that is not in the list does not
// compile; one that the wire or the command for a replay forgets fails here, and so does a role that is not kept.

#include "common/work/job_fields.h"

#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "common/work/wire.h"
#include "server/results.h"
#include "server/table_cache.h"
#include "tests/support/algorithm_of.h"

namespace lightloom {
namespace {

using Json = nlohmann::ordered_json;

const BuildIdentity kIdentity{"build", "profile", sha256("golden")};
const std::string kMain = "room.pbrt";

/// No field has the value that a forgotten one would have.
JobSpec full_spec() {
    JobSpec spec;
    spec.algorithm = testing::algorithm_of("lvcbpt", {{"cache", "500"}, {"connections", "3"}, {"rr-min", "0.25"}}).completed();
    spec.seed = ~0ull;
    spec.samples_per_pixel = 7;
    spec.time_limit_seconds = 1.5;
    spec.noise_target = 0.25;
    spec.max_depth = 9;
    spec.width = 64;
    spec.height = 48;
    spec.crop = {1, 2, 33, 44};
    spec.scene_root = sha256("scene");
    spec.frame = {64, 48, {1, 2, 33, 44}};
    spec.first_hit_layers = true;
    return spec;
}

std::string manifest_spec(const JobSpec& spec) {
    Manifest manifest;
    manifest.job.spec = spec;
    manifest.scene_main = kMain;
    return Json::parse(to_json(manifest))["spec"].dump();
}

/// Of a unit: a sample is also named by its place in the frame, which is no option of its own.
std::string replay(const JobSpec& spec) { return replay_command(spec, kMain, {{3, 1}, {5, 6, true}}); }

// Other values than the given one, each different in another part of it.
std::vector<AlgorithmSettings> others(const AlgorithmSettings& value) {
    std::vector<AlgorithmSettings> all{testing::algorithm_of("bdpt").completed()};
    for (const ParameterInfo& p : value.info().parameters) {
        const ByDepth<double> now = value.value_by_depth(p.name);
        const auto another = [&](double v) { return v == p.max_value ? p.min_value : p.max_value; };
        all.push_back(value.with(p.name, p.by_depth ? ByDepth<double>(another(now.at_first), now.later) : another(now.at_first)));
        if (p.by_depth) all.push_back(value.with(p.name, {now.at_first, another(now.later)}));
    }
    return all;
}
std::array<bool, 1> others(bool value) { return {!value}; }
std::vector<Digest> others(Digest value) {
    value.bytes[31] ^= 1;
    return {value};
}
std::vector<Rect> others(const Rect& value) {
    std::vector<Rect> windows(4, value);
    ++windows[0].x0, ++windows[1].y0, ++windows[2].x1, ++windows[3].y1;
    return windows;
}
std::vector<FrameLayout> others(const FrameLayout& value) {
    std::vector<FrameLayout> frames(6, value);
    ++frames[0].width, ++frames[1].height;
    ++frames[2].crop.x0, ++frames[3].crop.y0, ++frames[4].crop.x1, ++frames[5].crop.y1;
    return frames;
}
template <class T>
requires std::is_arithmetic_v<T> std::vector<T> others(T value) { return {T(value - 1)}; }

TEST(JobFields, EachDecidesWhatItsRolesSayAndTravels) {
    const JobSpec base = full_spec();
    for_each_job_field([&]<unsigned Roles, class T>(const JobField<Roles, T>& field) {
        const auto has = [](unsigned role) { return (Roles & role) != 0; };
        for (const T& value : others(base.*field.member)) {
            SCOPED_TRACE(std::string(field.name));
            JobSpec changed = base;
            changed.*field.member = value;
            ASSERT_FALSE(changed == base);
            EXPECT_EQ(!same_request(changed, base), has(job_role::kRequest));
            EXPECT_EQ(changed.spec_digest() != base.spec_digest(), has(job_role::kImage));
            EXPECT_EQ(table_key(kIdentity, changed) != table_key(kIdentity, base), has(job_role::kTables));
            EXPECT_EQ(manifest_spec(changed) != manifest_spec(base), has(job_role::kManifest));
            EXPECT_EQ(settings_json(changed) != settings_json(base), has(job_role::kSettings));
            EXPECT_EQ(replay(changed) != replay(base), has(job_role::kReplay));
            const auto settings = [](const JobSpec& spec) {
                const RenderSettings s = render_settings(spec);
                return std::tuple(s.algorithm, s.seed, s.max_depth);
            };
            EXPECT_EQ(settings(changed) != settings(base), has(job_role::kSettings));

            v1::JobSpec message;
            wire::put(changed, &message);
            const auto back = wire::get(message);
            ASSERT_TRUE(back.ok()) << back.status().message();
            EXPECT_TRUE(*back == changed);
        }
    });
    // The algorithm is two on the wire: its name and its parameters.
    EXPECT_EQ(size_t(v1::JobSpec::descriptor()->field_count()), std::tuple_size_v<decltype(kJobFields)> + 1);
}

/// A default that somebody writes down is the same job: only a repeated request tells the two apart, because it must be the same
/// text, and the choice of a training set, which a time limit may not change.
TEST(JobFields, WhichParametersWereChosenTravelsAndDecidesNothing) {
    JobSpec chosen = full_spec(), left = full_spec();
    left.algorithm = testing::algorithm_of("lvcbpt", {{"cache", "500"}, {"connections", "3"}, {"rr-min", "0.25"}});
    ASSERT_FALSE(left == chosen);
    EXPECT_FALSE(same_request(left, chosen));
    EXPECT_EQ(left.spec_digest(), chosen.spec_digest());
    EXPECT_EQ(table_key(kIdentity, left), table_key(kIdentity, chosen));
    EXPECT_EQ(manifest_spec(left), manifest_spec(chosen));
    EXPECT_EQ(replay(left), replay(chosen));
    v1::JobSpec message;
    wire::put(left, &message);
    const auto back = wire::get(message);
    ASSERT_TRUE(back.ok()) << back.status().message();
    EXPECT_TRUE(*back == left);
    EXPECT_FALSE(back->algorithm.chosen("light-paths"));
}

/// With as many rows as members, no member is in the list twice exactly if none is missing.
TEST(JobFields, NoneIsInTheListTwice) {
    std::set<std::string_view> names;
    std::vector<JobSpec> specs{full_spec()};
    for_each_job_field([&](const auto& field) {
        EXPECT_TRUE(names.insert(field.name).second) << field.name;
        JobSpec changed = full_spec();
        changed.*field.member = others(changed.*field.member).front();
        for (const JobSpec& other : specs) EXPECT_FALSE(other == changed) << field.name;
        specs.push_back(changed);
    });
}

/// Images name the digest of their spec, and tables lie under their key: neither may change unless what it stands for does. The
/// values are those of the versions that wrote every field out and carried parameters as text, and change only with the list of an
/// algorithm's parameters: all of them are written down, as they are in every accepted job.
TEST(JobFields, TextsAreThoseOfEarlierVersions) {
    JobSpec spec = full_spec();
    EXPECT_EQ(spec.spec_digest().hex(), "67e2abaa86edac9d2da0e4eb426d9a9c82cc55e2c7566b02a55fa0e43f7a26cf");
    const std::string key = "b5354f46cb63cfbd9ab46cb90085808ab373cb6412310986f17b2b5f1d905456";
    EXPECT_EQ(table_key(kIdentity, spec).hex(), key);
    EXPECT_EQ(
        manifest_spec(spec),
        R"({"algorithm":"lvcbpt","parameters":{"cache":"500","connections":"3","emission":"power","heuristic":"balance",)"
        R"("light-paths":"0.3","next-event":"1","roulette":"albedo","rr-min":"0.25","rr-start":"4","shadow-rays":"1","techniques":"all","training-paths":"20000"},"seed":18446744073709551615,"max_depth":9,)"
        R"("requested_samples_per_pixel":7,"time_limit_seconds":1.5,"noise_target":0.25,"layers":true,"scene":"room.pbrt",)"
        R"("scene_root":"4f48f7207cebf92638debb5694e4a8677350cf88a9e98e73c6c466b6b1d43890",)"
        R"("frame":{"width":64,"height":48,"crop":[1,2,33,44]}})");
    EXPECT_EQ(
        settings_json(spec).dump(),
        R"({"algorithm":"lvcbpt","parameters":{"cache":"500","connections":"3","emission":"power","heuristic":"balance",)"
        R"("light-paths":"0.3","next-event":"1","roulette":"albedo","rr-min":"0.25","rr-start":"4","shadow-rays":"1","techniques":"all","training-paths":"20000"},"seed":18446744073709551615,"max_depth":9})");
    EXPECT_EQ(
        replay(spec),
        "lightloom replay room.pbrt --algorithm lvcbpt --set cache=500 --set connections=3 --set emission=power "
        "--set heuristic=balance --set light-paths=0.3 --set next-event=1 --set roulette=albedo --set rr-min=0.25 --set rr-start=4 "
        "--set shadow-rays=1 --set techniques=all --set training-paths=20000 --seed "
        "18446744073709551615 "
        "--max-depth 9 --resolution 64x48 --crop 1,33,2,44 --spp 7 --unit 3,1");
    spec.first_hit_layers = false;
    EXPECT_EQ(spec.spec_digest().hex(), "4b2b2981325e3dec6fb65fe0f7eaf313688eed91b15badbe05b41ae71c6be1ca");
    EXPECT_EQ(table_key(kIdentity, spec).hex(), key) << "tables know nothing of layers";
}

}  // namespace
}  // namespace lightloom
