#include "client/progressive_render.h"

#include <ctime>

#include <algorithm>
#include <chrono>

namespace lightloom::client {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

double process_seconds() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

}  // namespace

std::vector<std::string> split_algorithms(const std::string& list) {
    std::vector<std::string> words(1);
    for (size_t i = 0; i < list.size(); ++i) {
        const bool digit_follows = i + 1 < list.size() && list[i + 1] >= '0' && list[i + 1] <= '9';
        if (list[i] == ',' && !digit_follows)
            words.emplace_back();
        else
            words.back() += list[i];
    }
    return words;
}

Result<AlgorithmChoice> parse_algorithm(const std::string& text) {
    std::map<std::string, std::string> parameters;
    size_t begin = std::min(text.find(':'), text.size());
    const std::string name = text.substr(0, begin);
    while (begin < text.size()) {
        const size_t end = std::min(text.find(':', begin + 1), text.size());
        const std::string setting = text.substr(begin + 1, end - begin - 1);
        const size_t equals = setting.find('=');
        if (equals == std::string::npos || equals == 0)
            return invalid_argument("algorithm \"" + text + "\": write NAME:KEY=VALUE:KEY=VALUE, not \"" + setting + "\"");
        if (!parameters.emplace(setting.substr(0, equals), setting.substr(equals + 1)).second)
            return invalid_argument("algorithm \"" + text + "\" sets " + setting.substr(0, equals) + " twice");
        begin = end;
    }
    const auto settings = AlgorithmSettings::parse(name, parameters);
    if (!settings.ok()) return settings.status();
    return AlgorithmChoice{settings->completed(), text};
}

Result<Preparation> prepare(const Scene& scene, const RenderSettings& settings, std::stop_token stop, TrainingReport* report) {
    if (!settings.algorithm.learning()) return Preparation{};
    const auto begin = Clock::now();
    TrainingReport own;
    if (!report) report = &own;
    auto tables = make_tables(scene, settings, std::move(stop), report);
    if (!tables.ok()) return tables.status();
    return Preparation{*std::move(tables), seconds_since(begin), report->note};
}

Result<ProgressiveRender> ProgressiveRender::start(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                   const Preparation& preparation) {
    const FrameLayout frame = scene->frame();
    const FilmResponse response = scene->description().film.response;
    const auto begin = Clock::now();
    auto renderer = Renderer::create(std::move(scene), settings, preparation.tables);
    if (!renderer.ok()) return renderer.status();
    return ProgressiveRender(std::move(renderer).value(), frame, Plan(frame, settings.algorithm), response,
                             preparation.seconds + seconds_since(begin));
}

ProgressiveRender::ProgressiveRender(std::unique_ptr<const Renderer> renderer, const FrameLayout& frame, const Plan& plan,
                                     const FilmResponse& response, double preparation_seconds)
    : renderer_(std::move(renderer)),
      frame_(frame),
      plan_(plan),
      response_(response),
      preparation_seconds_(preparation_seconds),
      sums_(frame, response),
      last_(frame) {}

Status ProgressiveRender::advance(uint64_t iteration_limit, std::stop_token stop) {
    if (cut_short_ || iterations() >= iteration_limit)
        return failed_precondition("the rendering has reached its " + std::to_string(iterations()) + " iterations");
    Group group = plan_.group(groups());
    const uint64_t left = iteration_limit - group.first_iteration;
    const bool cut = group.iteration_count > left;
    if (cut) group.iteration_count = uint32_t(left);

    sums_.drop_current();  // of a call that was stopped
    double seconds = 0, cpu_seconds = 0;
    for (const WorkUnit& unit : plan_.units(group)) {
        const auto begin = Clock::now();
        const double cpu_begin = process_seconds();
        const auto partial = renderer_->render(unit.render, stop);
        cpu_seconds += process_seconds() - cpu_begin;
        seconds += seconds_since(begin);
        if (!partial.ok()) return partial.status();
        LL_RETURN_IF_ERROR(sums_.add(*partial));
    }
    LL_RETURN_IF_ERROR(sums_.fold(group.iteration_count, &last_));
    last_iterations_ = group.iteration_count;
    cut_short_ = cut;
    seconds_ += seconds;
    cpu_seconds_ += cpu_seconds;
    return {};
}

Result<RgbImage> ProgressiveRender::last_group_image() const {
    if (groups() == 0) return failed_precondition("no group has been rendered yet");
    Accumulation alone(frame_, response_);
    LL_RETURN_IF_ERROR(alone.fold(last_, last_iterations_));
    return alone.develop();
}

}  // namespace lightloom::client
