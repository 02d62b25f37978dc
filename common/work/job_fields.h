#pragma once
// The fields of a JobSpec, listed once, each with the things that it decides. The spec's digest, the key of its tables,
// the equality of requests and the JSON of manifests are made from this list; the code for the wire and for the replay
// command is written by hand and checked against the list by job_fields_test.

#include <bit>
#include <cstddef>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>

#include "common/work/job.h"

namespace lightloom {

/// The roles of a field; every field travels on the wire.
namespace job_role {
inline constexpr unsigned kSettings = 1u << 0;  ///< It is a setting of light transport: render_settings().
inline constexpr unsigned kImage = 1u << 1;     ///< It decides the image, with any number of iterations: spec_digest().
inline constexpr unsigned kTables = 1u << 2;    ///< It decides the tables that are learned first: table_key().
inline constexpr unsigned kRequest = 1u << 3;   ///< The submitter gives it, not the coordinator: same_request().
inline constexpr unsigned kManifest = 1u << 4;  ///< The manifest shows it.
inline constexpr unsigned kReplay = 1u << 5;    ///< The command that renders a sample again names it.
}  // namespace job_role

template <unsigned Roles, class T>
struct JobField {
    std::string_view name;  ///< Name in digests and JSON.
    T JobSpec::*member;
    std::string_view yes = "yes", no = "no";  ///< Words of digests for the values of a bool.
};

template <unsigned Roles, class T, class... Words>
constexpr JobField<Roles, T> job_field(std::string_view name, T JobSpec::*member, Words... yes_no) {
    return {name, member, yes_no...};
}

/// The fields, in the order of digests, table keys and manifests, which all depend on it.
inline constexpr auto kJobFields = [] {
    using namespace job_role;
    constexpr unsigned kSetting = kSettings | kImage | kTables | kRequest | kManifest | kReplay;
    constexpr unsigned kBound = kRequest | kManifest;
    return std::tuple{
        job_field<kSetting>("algorithm", &JobSpec::algorithm),
        job_field<kSetting>("seed", &JobSpec::seed),
        job_field<kSetting>("max_depth", &JobSpec::max_depth),
        // A replay needs no time limit and no noise target: a job that one of them ended has a number of samples.
        job_field<kBound | kReplay>("requested_samples_per_pixel", &JobSpec::samples_per_pixel),
        job_field<kBound>("time_limit_seconds", &JobSpec::time_limit_seconds),
        job_field<kBound>("noise_target", &JobSpec::noise_target),
        // The frame results from these three and the scene.
        job_field<kRequest | kReplay>("width", &JobSpec::width),
        job_field<kRequest | kReplay>("height", &JobSpec::height),
        job_field<kRequest | kReplay>("crop", &JobSpec::crop),
        // A replay reads the scene from a path and derives the frame from the scene, the resolution and the crop window.
        job_field<kImage | kTables | kRequest | kManifest>("scene_root", &JobSpec::scene_root),
        job_field<kImage | kTables | kManifest>("frame", &JobSpec::frame),
        job_field<kImage | kRequest | kManifest>("layers", &JobSpec::first_hit_layers, "first-hit", "none"),
    };
}();

/// Calls visit(field) for each field, best with a lambda that names the needed parts of the type: [&]<unsigned Roles,
/// class T>(const JobField<Roles, T>& field) { ... spec.*field.member ... }
template <class Visit>
constexpr void for_each_job_field(Visit&& visit) {
    std::apply([&](const auto&... field) { (visit(field), ...); }, kJobFields);
}

namespace detail {

/// Stands for a value of any member's type.
struct AnyMember {
    template <class T>
    operator T() const;
};

/// The number of members of JobSpec: the most values from which one can be made.
template <class... Members>
constexpr size_t job_spec_members() {
    if constexpr (requires { JobSpec{Members{}..., AnyMember{}}; })
        return job_spec_members<Members..., AnyMember>();
    else
        return sizeof...(Members);
}

}  // namespace detail

static_assert(std::tuple_size_v<decltype(kJobFields)> == detail::job_spec_members<>(),
              "a member of JobSpec is missing from kJobFields, or no longer a member");

/// Appends a line with name and value. The length precedes the value, so that no two sets of values have the same text.
void append_text(std::string& out, std::string_view name, std::string_view value);

/// The text of the fields that have the role, as digests read it.
template <unsigned Role>
std::string fields_text(const JobSpec& spec) {
    std::string out;
    for_each_job_field([&]<unsigned Roles, class T>(const JobField<Roles, T>& field) {
        if constexpr ((Roles & Role) != 0) {
            const T& value = spec.*field.member;
            if constexpr (std::is_same_v<T, AlgorithmSettings>) {
                append_text(out, field.name, value.info().name);
                for (const auto& [key, text] : value.text()) append_text(out, "set " + key, text);
            } else if constexpr (std::is_same_v<T, Digest>) {
                append_text(out, field.name, value.hex());
            } else if constexpr (std::is_same_v<T, FrameLayout>) {
                const Rect& crop = value.crop;
                for (const int n : {value.width, value.height, crop.x0, crop.y0, crop.x1, crop.y1})
                    append_text(out, field.name, std::to_string(n));
            } else if constexpr (std::is_same_v<T, Rect>) {
                for (const int n : {value.x0, value.y0, value.x1, value.y1}) append_text(out, field.name, std::to_string(n));
            } else if constexpr (std::is_same_v<T, double>) {
                append_text(out, field.name, std::to_string(std::bit_cast<uint64_t>(value)));
            } else if constexpr (std::is_same_v<T, bool>) {
                append_text(out, field.name, value ? field.yes : field.no);
            } else {
                static_assert(std::is_integral_v<T>, "std::to_string() rounds: write another type's every digit");
                append_text(out, field.name, std::to_string(value));
            }
        }
    });
    return out;
}

}  // namespace lightloom
