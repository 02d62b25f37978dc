#pragma once
// Parameters that several algorithms have, and how their values are read; the catalog's rows list them.

#include <optional>

#include "common/path/corrected.h"
#include "common/path/mask.h"
#include "common/path/next_event.h"
#include "common/path/random_walk.h"
#include "common/transport/settings.h"

namespace lightloom {

inline constexpr ParameterInfo kRouletteStart{"rr-start",
                                              4,
                                              2,
                                              256,
                                              true,
                                              "sub-path vertices below this index never end by Russian roulette "
                                              "[Pharr, Jakob and Humphreys 2023, 2.2.4]"};
inline constexpr std::string_view kRoulette = "roulette";
inline constexpr std::string_view kRoulettes[] = {"albedo", "learned", "off"};
inline constexpr ParameterInfo kRouletteByAlbedo{
    kRoulette,
    0,
    0,
    2,
    true,
    "how sub-paths end by chance: by the power that they have lost; camera sub-paths by what training found that they may still "
    "gain, where they may divide, too [Rath et al. 2022]; or not at all. rr-start and rr-min belong to the first",
    kRoulettes};
inline bool learns_gain(const AlgorithmSettings& s) { return s.has(kRoulette) && s.value(kRoulette) == 1; }
// The weights know a typical survival at best, so that they trust a technique too much whose sub-path rarely survives:
// with 0.05 the scene `door` needs 1.4 (spcbpt), 1.7 (bdpt) and 2.5 (path) times the processor time for the same
// relMSE; with 1 the walks cost more than they save.
constexpr ParameterInfo roulette_minimum(double best) {
    return {"rr-min", best,
            0.01,     1,
            false,    "smallest survival probability of Russian roulette; 1 switches roulette off [measured: best of 0.05 to 1]"};
}
inline constexpr ParameterInfo kRouletteMin = roulette_minimum(0.5);
// What `path` finds at the end of a long sub-path it finds in no other way. relMSE times rays, relative to 0.5, is
// 0.72 (door), 0.77 (veach-ajar) and 0.98 (bedroom) with 0.7, and 0.78, 0.59 and 1.13 with 0.85.
inline constexpr ParameterInfo kRouletteMinOfPath = roulette_minimum(0.7);
inline constexpr std::string_view kHeuristicNames[] = {"balance",           "power",       "maximum", "popov",
                                                       "correlation-aware", "jendersie19", "vcm+",    "vcm*"};
/// The values of `heuristic`, in the order of kHeuristicNames.
enum class HeuristicChoice { kBalance, kPower, kMaximum, kPopov, kCorrelationAware, kJendersie19, kVcmPlus, kVcmStar };
inline constexpr std::string_view kSwitch[] = {"off", "on"};
/// How weights follow from densities. An algorithm has the first `count` names: three where no two samples of a pixel share a
/// sub-path, five where connections and shadow rays share the camera's, all where merging does.
constexpr ParameterInfo heuristic_parameter(HeuristicChoice best, int count) {
    constexpr std::string_view kHelp =
        "how techniques share a path: balance [Veach 1997, eq. 9.8], power with exponent 2, or maximum; balance, but samples that "
        "share a camera sub-path count as one [popov: Popov et al. 2015], as far as they are independent [correlation-aware: "
        "Grittmann et al. 2021]; and for merges alone, by the footprints of both sub-paths [jendersie19: Jendersie 2019], or over "
        "the photons that training found around a vertex [vcm+, vcm*: Jendersie and Grosch 2018, eq. 6 and 7]";
    constexpr size_t kOfSharing = kHelp.find("; and for merges"), kPlain = kHelp.find("; balance, but");
    return {"heuristic",
            double(int(best)),
            0,
            double(count - 1),
            true,
            count <= 3   ? kHelp.substr(0, kPlain)
            : count <= 5 ? kHelp.substr(0, kOfSharing)
                         : kHelp,
            std::span(kHeuristicNames).first(size_t(count))};
}
inline constexpr ParameterInfo kHeuristic = heuristic_parameter(HeuristicChoice::kBalance, 3),
                               kHeuristicOfSharing = heuristic_parameter(HeuristicChoice::kBalance, 5);
inline constexpr std::string_view kTechniqueSets[] = {"all",     "no-hit",   "no-next-event", "no-connect",
                                                      "no-lens", "no-merge", "merge"};
/// Which techniques remain, in the order of kTechniqueSets; `count` of them are for the algorithm.
constexpr ParameterInfo techniques_parameter(int count) {
    return {
        "techniques",
        0,
        0,
        double(count - 1),
        true,
        "which techniques are used; the weights of those that remain sum to one, but light that only another one finds is missing",
        std::span(kTechniqueSets).first(size_t(count))};
}
inline constexpr ParameterInfo kTechniques = techniques_parameter(5), kTechniquesOfMerging = techniques_parameter(7);
/// The techniques that the settings leave; null if all.
inline std::optional<TechniqueMask> techniques_of(const AlgorithmSettings& s) {
    const int set = s.has(kTechniques.name) ? int(s.value(kTechniques.name)) : 0;
    if (set == 0) return std::nullopt;
    TechniqueMask mask{.visible_stays = true};
    if (set <= kTechniqueKinds) {
        mask.on[set - 1] = false;  // the sets after the first leave out one kind each, in the order of the kinds
    } else {
        for (const TechniqueKind kind : {TechniqueKind::kNextEvent, TechniqueKind::kConnect, TechniqueKind::kLens})
            mask.on[int(kind)] = false;  // hits stay: what is seen directly or in a mirror cannot be merged
    }
    return mask;
}
inline constexpr int kMaxNextEventRays = 64;
/// kNextEvent is for algorithms that cannot do without next event estimation, kNextEventBesideCache for those that also
/// connect to points on lights from a cache.
inline constexpr ParameterInfo kNextEvent{
    "next-event",      1,    1,
    kMaxNextEventRays, true, "shadow rays of next event estimation at the camera's first hit; later hits send one"};
// The default is one ray at the first hit only, because at later vertices the cache does as well for less work. Noise
// times rays, relative to no ray at all, is 0.93 with one ray at every vertex, 0.93 with one at the first only and 0.92
// with two there (`lvcbpt`), and 1.08, 1.02 and 1.01 (`spcbpt`; geometric means of six scenes). Without any ray, narrow
// spots are noisier than with `path`.
inline constexpr ParameterInfo kNextEventBesideCache{"next-event",
                                                     1,
                                                     0,
                                                     kMaxNextEventRays,
                                                     true,
                                                     "shadow rays of next event estimation, beside the cache's connections to "
                                                     "lights, at the camera's first hit; later hits send none"};
/// Splitting. A camera vertex that found its way once asks for light n times.
inline constexpr ParameterInfo kShadowRays{"shadow-rays",
                                           1,
                                           1,
                                           1024,
                                           true,
                                           "n: every ray of next event estimation is split into so many, to places spread evenly "
                                           "[Grittmann et al. 2021, section 3]"};
/// Beside a cache 1 leaves later hits to the cache, as kNextEventBesideCache says.
inline constexpr ParameterInfo kShadowRaysBesideCache{
    "shadow-rays",
    1,
    1,
    1024,
    true,
    "n: from 2 on, every camera vertex sends so many shadow rays of next event estimation, its first hit next-event times as many "
    "[Grittmann et al. 2021, section 3]"};
inline constexpr ParameterInfo kLightPaths{
    "light-paths",
    0.3,
    0.001,
    64,
    false,
    "N1 and M: light sub-paths per pixel and iteration; all of them splat and fill the cache "
    "[Su et al. 2022, section 8.1: 1e5 per iteration, 0.05 per pixel]"};
inline constexpr ParameterInfo kCache{"cache",
                                      20000,
                                      1,
                                      1e8,
                                      true,
                                      "smallest number of light sub-paths in a unit's cache, however few camera samples it has "
                                      "[Davidovic et al. 2014 fill one per image]"};
// The first hit makes up most of an image, so that five connections there and two behind it are worth more than three
// everywhere: noise times rays, relative to (3,3), is 0.98 with (4,3), 0.90 with (5,2), 0.95 with (5,3), 0.94 with (4,2), 0.90
// with (6,2) and 0.93 with (3,2) (`spcbpt`), and 0.98, 0.97, 0.99, 0.97, 0.99 and 1.02 (`lvcbpt`); noise times processor time
// 0.89 and 0.98 with (5,2) (geometric means of seven scenes, `lvcbpt` of six).
inline constexpr ParameterInfo kConnections{
    "connections", {5, 2}, 1, 64, true, "N: connections per camera vertex [Su et al. 2022, table 3]", {}, true};
inline constexpr std::string_view kEmissions[] = {"power", "learned"};
inline constexpr std::string_view kEmission = "emission";
/// How light sub-paths leave the lights, with the algorithm's default.
constexpr ParameterInfo emission_parameter(bool learned) {
    return {kEmission,
            learned ? 1.0 : 0.0,
            0,
            1,
            true,
            "how light sub-paths leave the lights: in proportion to power, or where and in the directions that training found "
            "useful [guided emission: Vorba et al. 2014]",
            kEmissions};
}
inline bool learns_emission(const AlgorithmSettings& s) { return s.has(kEmission) && s.value(kEmission) != 0; }
/// The size of a training set; a time-limited job may make it smaller.
inline constexpr std::string_view kTrainingPaths = "training-paths";

/// For algorithms that learn nothing but emission and gains.
inline constexpr ParameterInfo kEmissionTraining{
    kTrainingPaths,
    100000,
    1,
    1e8,
    true,
    "camera samples of the training set, each with a light sub-path; at most, where a job settles it"};

/// The algorithm's rule for Russian roulette; the defaults if it has no such parameters.
inline RouletteRule roulette_of(const AlgorithmSettings& s) {
    RouletteRule rule;
    if (!s.has(kRouletteStart.name) || !s.has(kRouletteMin.name)) return rule;
    rule.first_vertex = int(s.value(kRouletteStart.name));
    rule.min_survival = float(s.value(kRouletteMin.name));
    if (s.has(kRoulette) && s.value(kRoulette) == 2) rule.min_survival = 1;
    return rule;
}
inline NextEventRays next_event_of(const AlgorithmSettings& s) {
    const int split = int(s.value(kShadowRays.name));
    return {int(s.value(kNextEvent.name)) * split, split};
}
/// Rays of next event estimation besides a cache; see kNextEventBesideCache and kShadowRaysBesideCache.
inline NextEventRays next_event_beside_cache_of(const AlgorithmSettings& s) {
    const int split = int(s.value(kShadowRaysBesideCache.name));
    return {int(s.value(kNextEventBesideCache.name)) * split, split > 1 ? split : 0};
}
inline HeuristicChoice heuristic_choice_of(const AlgorithmSettings& s) {
    return s.has(kHeuristic.name) ? HeuristicChoice(int(s.value(kHeuristic.name))) : HeuristicChoice::kBalance;
}
inline Heuristic heuristic_of(const AlgorithmSettings& s) {
    const HeuristicChoice choice = heuristic_choice_of(s);
    return choice == HeuristicChoice::kPower     ? Heuristic::kPower
           : choice == HeuristicChoice::kMaximum ? Heuristic::kMaximum
                                                 : Heuristic::kBalance;
}
inline Correction correction_of(const AlgorithmSettings& s) {
    switch (heuristic_choice_of(s)) {
        case HeuristicChoice::kPopov: return Correction::kOne;
        case HeuristicChoice::kCorrelationAware: return Correction::kCorrelation;
        case HeuristicChoice::kJendersie19: return Correction::kFootprint;
        case HeuristicChoice::kVcmPlus: return Correction::kPhotons;
        case HeuristicChoice::kVcmStar: return Correction::kPhotonsBalanced;
        case HeuristicChoice::kBalance:
        case HeuristicChoice::kPower:
        case HeuristicChoice::kMaximum: return Correction::kUncorrected;
    }
    return Correction::kUncorrected;
}
/// Whether weights read how many photons there are around a vertex.
inline bool learns_density(const AlgorithmSettings& s) {
    const Correction correction = correction_of(s);
    return correction == Correction::kPhotons || correction == Correction::kPhotonsBalanced;
}

/// AlgorithmInfo::light_paths_per_pixel of algorithms that trace one light path per camera sample, and of those that let the user
/// choose.
inline double one_light_path(const AlgorithmSettings&) { return 1; }
inline double chosen_light_paths(const AlgorithmSettings& s) { return s.value(kLightPaths.name); }

/// What algorithms with a light-vertex cache have in common.
struct CacheParameters {
    ByDepth<int> connections;  ///< N
    uint64_t minimum_paths;    ///< Smallest number of light paths in a unit's cache.

    static CacheParameters of(const AlgorithmSettings& s) {
        return {s.value_by_depth(kConnections.name).each([](double n) { return int(n); }), uint64_t(s.value(kCache.name))};
    }
};

}  // namespace lightloom
