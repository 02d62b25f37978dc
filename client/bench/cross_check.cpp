#include "client/bench/cross_check.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "common/metrics/significance.h"

namespace lightloom::client {
namespace {

constexpr double kDoubtLevel = 0.05, kDifferLevel = 0.001;
constexpr double kNoisyWidth = 0.2;
/// Longest paths that carry less than this share of the image's light together are compared together: alone they would be
/// too rare for the t distribution to hold.
constexpr double kTailShare = 0.02;

const char* text_of(Verdict verdict) {
    switch (verdict) {
        case Verdict::kAgree: return "agree";
        case Verdict::kNoisy: return "too noisy to tell";
        case Verdict::kDoubtful: return "doubtful";
        case Verdict::kDiffer: return "differ";
    }
    return "";
}

nlohmann::ordered_json estimate_json(const Estimate& e) { return {{"mean", e.mean}, {"standard_error", e.standard_error()}}; }

std::vector<std::string> image_rows() {
    std::vector<std::string> what{"image"};
    for (int row = 1; row <= kCheckRows; ++row) {
        for (int column = 1; column <= kCheckColumns; ++column)
            what.push_back("region " + std::to_string(column) + "," + std::to_string(row));
    }
    return what;
}

}  // namespace

Verdict CrossCheck::verdict() const {
    Verdict worst = Verdict::kAgree;
    for (const CrossCheckRow& row : rows) worst = std::max(worst, row.verdict);
    return worst;
}

std::string CrossCheck::table() const {
    char line[160];
    std::snprintf(line, sizeof line, "%-20s %12s %12s %9s  %-22s\n", "", "reference", "check", "ratio", "95 %, all together");
    std::string table = line;
    for (const CrossCheckRow& row : rows) {
        const RatioInterval& i = row.interval;
        std::snprintf(line, sizeof line, "%-20s %12.6g %12.6g %9.5f  [%9.5f, %9.5f] %s\n", row.what.c_str(), row.reference.mean,
                      row.check.mean, i.ratio, i.low, i.high, row.verdict == Verdict::kAgree ? "" : text_of(row.verdict));
        table += line;
    }
    return table;
}

nlohmann::ordered_json CrossCheck::json() const {
    nlohmann::ordered_json json{
        {"outcome", text_of(verdict())}, {"iterations", iterations},     {"seconds", seconds},
        {"doubtful_level", kDoubtLevel}, {"differ_level", kDifferLevel}, {"rows", nlohmann::ordered_json::array()}};
    for (const CrossCheckRow& row : rows) {
        json["rows"].push_back({{"what", row.what},
                                {"reference", estimate_json(row.reference)},
                                {"check", estimate_json(row.check)},
                                {"ratio", row.interval.ratio},
                                {"low", row.interval.low},
                                {"high", row.interval.high},
                                {"outcome", text_of(row.verdict)}});
    }
    return json;
}

CrossCheck compare_estimates(const std::vector<std::string>& what, const std::vector<Estimate>& references,
                             const std::vector<Estimate>& checks) {
    CrossCheck result;
    const double doubt = sidak(kDoubtLevel, int(what.size())), differ = sidak(kDifferLevel, int(what.size()));
    for (size_t i = 0; i < what.size(); ++i) {
        CrossCheckRow row{what[i], references[i], checks[i], ratio_interval(checks[i], references[i], doubt)};
        // A mean of zero comes without variance because no sample was found, which is not knowledge of a zero: whatever the check
        // has found, the reference cannot contradict it.
        if (row.reference.mean == 0 && row.check.mean != 0) row.interval.low = 0;
        if (row.interval.excludes(0)) {
            const bool beyond_doubt = ratio_interval(checks[i], references[i], differ).excludes(0);
            row.verdict = beyond_doubt ? Verdict::kDiffer : Verdict::kDoubtful;
        } else if (!row.interval.within(kNoisyWidth)) {
            row.verdict = Verdict::kNoisy;
        }
        result.rows.push_back(std::move(row));
    }
    return result;
}

Estimate LengthMeans::estimate(size_t first, size_t last) const {
    WeightedMean mean;
    for (size_t g = 0; g < groups.size(); ++g) {
        double sum = 0;
        for (size_t length = first; length <= last; ++length) sum += groups[g][length - 1];
        mean.add(sum, weights[g]);
    }
    return mean.estimate();
}

Result<LengthMeans> measure_lengths(const std::shared_ptr<const Scene>& scene, const RenderSettings& settings, double seconds,
                                    const PreparationSource& tables, std::stop_token stop) {
    const auto preparation = tables(settings);
    if (!preparation.ok()) return preparation.status();
    std::vector<ProgressiveRender> renders;
    for (int depth = 0; depth <= settings.max_depth; ++depth) {
        RenderSettings restricted = settings;
        restricted.max_depth = depth;
        auto render = ProgressiveRender::start(scene, restricted, *preparation);
        if (!render.ok()) return render.status();
        renders.push_back(std::move(render).value());
    }
    LengthMeans means;
    while (means.seconds < seconds || means.groups.size() < kLeastGroups) {
        std::vector<double> group;
        double shorter = 0;
        means.seconds = 0;
        for (ProgressiveRender& render : renders) {
            LL_RETURN_IF_ERROR(render.advance(std::numeric_limits<uint64_t>::max(), stop));
            const auto image = render.last_group_image();
            if (!image.ok()) return image.status();
            const double mean = luminance_means(*image, 1, 1)[0];
            group.push_back(mean - shorter);
            shorter = mean;
            means.seconds += render.seconds();
        }
        means.groups.push_back(std::move(group));
        means.weights.push_back(renders.front().last_group_iterations());
    }
    return means;
}

Result<CrossCheck> cross_check(const std::shared_ptr<const Scene>& scene, const RenderSettings& producer,
                               const std::vector<Estimate>& made, const RenderSettings& checker, double seconds,
                               const PreparationSource& tables, std::stop_token stop) {
    const auto preparation = tables(checker);
    if (!preparation.ok()) return preparation.status();
    auto render = ProgressiveRender::start(scene, checker, *preparation);
    if (!render.ok()) return render.status();
    RegionMeans checked(kCheckColumns, kCheckRows);
    while (render->seconds() < seconds || render->groups() < kLeastGroups) {
        LL_RETURN_IF_ERROR(render->advance(std::numeric_limits<uint64_t>::max(), stop));
        const auto image = render->last_group_image();
        if (!image.ok()) return image.status();
        checked.add(*image, render->last_group_iterations());
    }
    const auto produced_lengths = measure_lengths(scene, producer, seconds / 2, tables, stop);
    if (!produced_lengths.ok()) return produced_lengths.status();
    const auto checked_lengths = measure_lengths(scene, checker, seconds / 2, tables, stop);
    if (!checked_lengths.ok()) return checked_lengths.status();

    std::vector<std::string> what = image_rows();
    std::vector<Estimate> references = made, checks = checked.estimates();
    const size_t longest = size_t(producer.max_depth) + 1;
    size_t tail = longest;
    const double least = kTailShare * produced_lengths->estimate(1, longest).mean;
    while (tail > 1 && produced_lengths->estimate(tail, longest).mean < least) --tail;
    for (size_t length = 1; length <= tail; ++length) {
        const bool together = length == tail && tail < longest;
        const size_t last = together ? longest : length;
        what.push_back("length " + std::to_string(length) + (together ? " and more" : ""));
        references.push_back(produced_lengths->estimate(length, last));
        checks.push_back(checked_lengths->estimate(length, last));
    }
    CrossCheck result = compare_estimates(what, references, checks);
    result.iterations = render->iterations();
    result.seconds = render->seconds() + produced_lengths->seconds + checked_lengths->seconds;
    return result;
}

}  // namespace lightloom::client
