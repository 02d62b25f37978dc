#pragma once
// What a report says of one scene at one budget: the runs of every algorithm together.

#include <optional>
#include <string>
#include <vector>

#include "client/report/figures.h"
#include "client/report/results.h"

namespace lightloom::client::report {

/// The error that a report shows of a checkpoint: relMSE without the reference's noise where that is known. Of that noise a tenth
/// is the least that is shown, because below it the difference is noise itself.
double shown_error(const Checkpoint& point, const SceneInfo& scene);

/// Errors below this are marked as near the reference's noise: the measured relMSE is less than four times that noise. 0: not
/// known.
double least_certain_error(const SceneInfo& scene);

/// How often a run's own estimate of its relMSE lay within a factor of 1.5 of the true one, over the last three octaves of samples
/// and away from the reference's noise.
struct Tracking {
    int checkpoints = 0, within = 0;
};

/// One algorithm.
struct Series {
    std::string label;
    size_t style = 0;              ///< Its place among all labels of the report, from which colour, dash and symbol come.
    std::vector<const Run*> runs;  ///< By seed.
    Band by_time, by_samples;      ///< Errors; time includes preparation.
    Band ratio;                    ///< Estimated over true relMSE against samples.
    Tracking tracking;
    double error = 0;  ///< At the end, median over the seeds, as the rest here.
    std::optional<double> error_uncertainty;
    double seconds = 0, preparation = 0, samples = 0;  ///< Seconds with preparation.
    std::optional<SpeedUp> speed_up;                   ///< Relative to the panel's first algorithm.
    bool near_floor = false;
    std::vector<std::string> marks;  ///< What one must know of these runs, in a few words each.
};

struct Panel {
    const SceneInfo* scene = nullptr;
    Budget budget;
    std::string title;           ///< The scene's name, with the budget where the scene has several.
    std::vector<Series> series;  ///< In the order of the report's labels.
    double level = 0;            ///< Error at which speeds are compared: what the first algorithm ends with.
    std::vector<FrontPiece> front;
};

/// One cell of the summary.
struct Comparison {
    std::vector<std::string> labels;  ///< All of the report.
    std::vector<Panel> panels;        ///< In the order of the scenes.
    /// Of each label over all panels in which it and the first one are.
    std::vector<std::optional<SpeedUp>> means;
    std::vector<int> mean_counts;
};

/// The results must outlive what is returned.
Comparison compare_results(const Results& results);

}  // namespace lightloom::client::report
