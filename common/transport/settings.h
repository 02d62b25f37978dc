#pragma once
// Settings of a render: checked once, where text comes in, and carried as a typed object from then on.

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/result.h"
#include "common/transport/catalog.h"

namespace lightloom {

/// An algorithm of the catalog with a value for each of its parameters. Every object of this class is valid.
class AlgorithmSettings {
  public:
    /// The catalog's first algorithm with its defaults.
    AlgorithmSettings();
    /// kInvalidArgument for an algorithm that the catalog does not have (naming those that it has), for a parameter
    /// that the algorithm does not have, and for a value that is out of range or neither a number nor the name of a
    /// choice.
    static Result<AlgorithmSettings> parse(std::string_view name, const std::map<std::string, std::string>& set);

    const AlgorithmInfo& info() const { return *info_; }
    /// How the tables for these settings are learned; null if they need none.
    const LearningInfo* learning() const {
        const LearningInfo* learning = info_->learning;
        return learning && (!learning->wanted || learning->wanted(*this)) ? learning : nullptr;
    }
    /// AlgorithmInfo::merges and frame, of these settings.
    bool merges() const { return info_->merges || (info_->may_merge && info_->may_merge(*this)); }
    FrameShape frame() const { return info_->may_merge && info_->may_merge(*this) ? FrameShape::kWhole : info_->frame; }
    std::string name() const { return std::string(info_->name); }
    bool has(std::string_view parameter) const { return index(parameter) < values_.size(); }
    /// The value of a parameter, which the algorithm must have and which must be one number.
    double value(std::string_view parameter) const;
    /// The same for one that may be two numbers; of any other, both are its value.
    const ByDepth<double>& value_by_depth(std::string_view parameter) const;
    /// Whether the text that these settings come from named the parameter.
    bool chosen(std::string_view parameter) const;
    /// The same settings with every parameter marked as chosen, so that the defaults in force are recorded.
    AlgorithmSettings completed() const;
    /// The same settings with one parameter chosen, at a value in its range.
    AlgorithmSettings with(std::string_view parameter, const ByDepth<double>& value) const;
    /// All parameters with their values as canonical text, so that an image says what was rendered even where defaults applied.
    /// Choices are numbers there, as they are in digests, on the wire and in the header of an EXR.
    std::map<std::string, std::string> text() const;
    /// The same for the chosen parameters alone; parse() makes these settings from it again.
    std::map<std::string, std::string> chosen_text() const;
    /// text() and chosen_text() with the names of choices, as people read and write them; parse() understands these, too.
    std::map<std::string, std::string> named_text() const;
    std::map<std::string, std::string> chosen_named_text() const;

    /// N1: light paths per pixel and iteration; 0 for an algorithm that traces none.
    double light_paths_per_pixel() const { return info_->light_paths_per_pixel ? info_->light_paths_per_pixel(*this) : 0; }
    /// N1 |crop| as a whole number, at least one where the algorithm traces light: a constant of the frame, so that the
    /// weights of every group use the number that the group really traces.
    uint64_t light_paths_per_iteration(int64_t crop_pixels) const;

    /// True if algorithm and values are the same, and the same parameters are chosen.
    friend bool operator==(const AlgorithmSettings&, const AlgorithmSettings&) = default;

  private:
    explicit AlgorithmSettings(const AlgorithmInfo& info);
    std::map<std::string, std::string> chosen_text(bool named) const;
    size_t index(std::string_view parameter) const;

    const AlgorithmInfo* info_;
    std::vector<ByDepth<double>> values_;  ///< In the order of info_->parameters.
    std::vector<bool> chosen_;
};

struct RenderSettings {
    AlgorithmSettings algorithm;
    uint64_t seed = 0;
    int max_depth = 5;  ///< Bounces; paths have at most max_depth + 1 edges.

    int max_edges() const { return max_depth + 1; }
};

/// kInvalidArgument when the depth is out of range.
Status check_depth(int max_depth);

}  // namespace lightloom
