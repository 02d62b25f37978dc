#include "common/tables/train_gamma.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "common/core/fork_join.h"
#include "common/core/math.h"
#include "common/core/rng.h"

namespace lightloom {
namespace {

/// One level of the nested classifications: labels that agree in all but their lowest `bits` bits are one subspace.
struct Level {
    uint32_t bits, source_count, coarse_sources, light_count, eye_count;

    Level(const GammaDataset& d, uint32_t level_bits)
        : bits(level_bits),
          source_count(d.source_count),
          coarse_sources(up(d.source_count)),
          light_count(coarse_sources + up(d.light_count - d.source_count)),
          eye_count(up(d.eye_count)) {}
    uint32_t up(uint32_t n) const { return (n + (1u << bits) - 1) >> bits; }
    uint32_t light(uint32_t i) const { return i < source_count ? i >> bits : coarse_sources + ((i - source_count) >> bits); }
    uint32_t eye(uint32_t j) const { return j >> bits; }
};

/// The training problem on one level: evaluates and improves a matrix B (column-major). Columns that no path uses are
/// left alone: the loss does not depend on them, and nothing but the prior is known of them. A node's entry of B and its
/// gain are derived from its finest labels wherever they are needed: stored, they would be the largest arrays of all.
class LevelProblem {
  public:
    LevelProblem(const GammaDataset& data, uint32_t bits, double mix) : data_(&data), level_(data, bits), mix_(mix) {
        energy_.assign(level_.light_count, 0.0);
        for (uint32_t i = 0; i < data.light_count; ++i) energy_[level_.light(i)] += double(data.energy[i]);
        const double total = std::accumulate(energy_.begin(), energy_.end(), 0.0);
        floor_.reserve(energy_.size());
        for (const double q : energy_) floor_.push_back(0.5 / level_.light_count + 0.5 * q / total);
        // g holds 1 / Q of the finest subspace; Gamma_IJ Q_i / Q_I is its lifted entry [common/path/README.md, "Nested
        // families"].
        for (uint32_t i = 0; i < data.light_count; ++i) {
            const double share = double(data.energy[i]) / energy_[level_.light(i)];
            row_.push_back(level_.light(i));
            gain_.push_back(float((1 - mix) * share));
            floor_gain_.push_back(float(mix * share * floor_[row_.back()]));
        }
        std::vector<bool> named(level_.eye_count);
        for (const GammaNode& n : data.nodes) named[level_.eye(n.eye)] = true;
        for (uint32_t j = 0; j < level_.eye_count; ++j)
            if (named[j]) columns_.push_back(j);
    }
    const Level& level() const { return level_; }
    size_t size() const { return size_t(level_.light_count) * level_.eye_count; }

    std::vector<float> flat_prior() const {
        std::vector<float> prior(size());
        for_columns(level_.eye_count, [&](size_t j) {
            for (uint32_t i = 0; i < level_.light_count; ++i) prior[j * level_.light_count + i] = float(floor_[i]);
        });
        return prior;
    }
    /// Turns B of a coarser level into this level's prior: the parts of a subspace share its mass in proportion to
    /// their energy.
    std::vector<float> lifted(const LevelProblem& coarse, const std::vector<float>& b) const {
        std::vector<std::pair<uint32_t, double>> from(level_.light_count);  // the coarse label, and this part's share of it
        for (uint32_t i = 0; i < level_.light_count; ++i) {
            const uint32_t c = coarse.level_.light(finest_light(i));
            from[i] = {c, energy_[i] / coarse.energy_[c]};
        }
        std::vector<float> out(size());
        for_columns(level_.eye_count, [&](size_t j) {
            const float* parent = &b[size_t(coarse.level_.eye(uint32_t(j) << level_.bits)) * coarse.level_.light_count];
            float* column = &out[j * level_.light_count];
            for (uint32_t i = 0; i < level_.light_count; ++i) column[i] = float(double(parent[from[i].first]) * from[i].second);
        });
        return out;
    }
    std::vector<float> mixed(const std::vector<float>& b) const {
        std::vector<float> gamma(b.size());
        for_columns(level_.eye_count, [&](size_t j) {
            for (uint32_t i = 0; i < level_.light_count; ++i) {
                const size_t c = j * level_.light_count + i;
                gamma[c] = float((1 - mix_) * double(b[c]) + mix_ * floor_[i]);
            }
        });
        return gamma;
    }
    double loss(const std::vector<float>& b, const std::vector<uint32_t>& paths) const {
        // The parts do not depend on the number of threads, and neither does their sum.
        std::vector<double> parts((paths.size() + kLossPart - 1) / kLossPart);
        fork_join(parts.size(), [&](size_t first, size_t last) {
            for (size_t part = first; part < last; ++part) {
                const size_t end = std::min(paths.size(), (part + 1) * kLossPart);
                for (size_t x = part * kLossPart; x < end; ++x) {
                    const double f = density(paths[x], b);
                    if (f > 0) parts[part] += double(data_->paths[paths[x]].weight) / f;
                }
            }
        });
        return paths.empty() ? 0 : std::accumulate(parts.begin(), parts.end(), 0.0) / double(paths.size());
    }
    /// Negative gradient of the loss' sum with respect to B, in the columns that paths use; the others of `out` are not
    /// touched. `out` may become larger than B: what lies behind is working memory.
    void gradient(const std::vector<float>& b, const uint32_t* begin, const uint32_t* end, std::vector<double>* out) const {
        const size_t paths = size_t(end - begin);
        // A sum is cleared and added up for each slice, which few paths are not worth. No thread count may decide here:
        // the order of a sum would depend on it.
        const size_t nodes = size_t(double(data_->nodes.size()) * double(paths) / double(std::max<size_t>(1, data_->paths.size())));
        const size_t slices = std::clamp(nodes / (2 * size()), size_t(1), kMostSlices);
        out->resize(std::max(out->size(), slices * size()));
        fork_join(slices, [&](size_t first, size_t last) {
            for (size_t slice = first; slice < last; ++slice)
                add_gradient(b, begin + paths * slice / slices, begin + paths * (slice + 1) / slices, &(*out)[slice * size()]);
        });
        if (slices == 1) return;
        for_columns(columns_.size(), [&](size_t k) {
            double* column = &(*out)[size_t(columns_[k]) * level_.light_count];
            for (size_t slice = 1; slice < slices; ++slice)
                for (uint32_t i = 0; i < level_.light_count; ++i) column[i] += column[slice * size() + i];
        });
    }
    /// One majorise-minimise step per column: B <- sqrt(B^2 G + lambda Gbar pi^2), normalised [common/path/README.md, "Trainer"].
    /// `g` is working memory for a gradient.
    void improve(std::vector<float>* b, const std::vector<float>& prior, double lambda, const std::vector<uint32_t>& paths,
                 std::vector<double>* g) const {
        gradient(*b, paths.data(), paths.data() + paths.size(), g);
        std::vector<double> sums(columns_.size());
        for_columns(columns_.size(), [&](size_t k) {
            const size_t column = size_t(columns_[k]) * level_.light_count;
            for (size_t c = column; c < column + level_.light_count; ++c) sums[k] += double((*b)[c]) * (*g)[c];
        });
        const double mean = std::accumulate(sums.begin(), sums.end(), 0.0) / level_.eye_count;
        for_columns(columns_.size(), [&](size_t k) {
            const size_t column = size_t(columns_[k]) * level_.light_count;
            double sum = 0;
            for (size_t c = column; c < column + level_.light_count; ++c) {
                const double old = double((*b)[c]), pi = double(prior[c]);
                (*g)[c] = std::sqrt(old * old * (*g)[c] + lambda * mean * pi * pi);
                sum += (*g)[c];
            }
            if (!(sum > 0)) return;  // neither paths nor the prior have weight here: the column stays
            for (size_t c = column; c < column + level_.light_count; ++c) (*b)[c] = float((*g)[c] / sum);
        });
    }

  private:
    template <class Body>
    static void for_columns(size_t count, const Body& body) {
        fork_join(count, [&](size_t first, size_t last) {
            for (size_t j = first; j < last; ++j) body(j);
        });
    }
    /// Most parts of the paths whose gradients are summed at the same time, each in a matrix of its own.
    static constexpr size_t kMostSlices = 4;
    static constexpr size_t kLossPart = 4096;

    size_t cell(const GammaNode& n) const { return size_t(level_.eye(n.eye)) * level_.light_count + row_[n.light]; }
    /// F of a path.
    double density(uint32_t path, const std::vector<float>& b) const {
        const GammaPath& p = data_->paths[path];
        double f = double(p.fixed);
        for (uint32_t k = p.first_node; k < p.first_node + p.node_count; ++k) {
            const GammaNode& n = data_->nodes[k];
            f += double(n.g) * (double(gain_[n.light]) * double(b[cell(n)]) + double(floor_gain_[n.light]));
        }
        return f;
    }
    void add_gradient(const std::vector<float>& b, const uint32_t* begin, const uint32_t* end, double* out) const {
        for (const uint32_t column : columns_) std::fill_n(out + size_t(column) * level_.light_count, level_.light_count, 0.0);
        for (const uint32_t* x = begin; x != end; ++x) {
            const GammaPath& p = data_->paths[*x];
            const double f = density(*x, b);
            if (!(f > 0)) continue;
            const double scale = double(p.weight) / (f * f);
            for (uint32_t k = p.first_node; k < p.first_node + p.node_count; ++k) {
                const GammaNode& n = data_->nodes[k];
                out[cell(n)] += scale * double(n.g) * double(gain_[n.light]);
            }
        }
    }
    uint32_t finest_light(uint32_t i) const {
        return i < level_.coarse_sources ? i << level_.bits : data_->source_count + ((i - level_.coarse_sources) << level_.bits);
    }

    const GammaDataset* data_;
    Level level_;
    double mix_;
    std::vector<double> energy_;
    std::vector<double> floor_;      ///< What the mix adds to an entry, by light label.
    std::vector<uint32_t> columns_;  ///< Columns that a path uses, ascending.
    // By finest light label: its label on this level, and by how much B and the mix raise F per unit of g.
    std::vector<uint32_t> row_;
    std::vector<float> gain_, floor_gain_;
};

constexpr double kStrengths[] = {0.01, 0.1, 1, 10, 100};
constexpr double kCoarseStrength = 0.1;
constexpr int kCoarseSteps = 4, kStepsPerStrength = 4, kFinalSteps = 3;

/// On levels with at most this many bits the prior's strength is chosen by trial. It matters where data are thin, which
/// is on the fine levels.
constexpr uint32_t kFineBits = 2;

/// Counts the steps on the finest levels, which take nearly all the time, and reports the share that is done. A level
/// seldom tries more than three strengths, so that share is as if each tried three.
class Steps {
  public:
    Steps(uint32_t coarsest_bits, const std::function<void(double)>& report)
        : levels_(int(std::min(coarsest_bits, kFineBits)) + 1),
          report_(report) {}
    void done_on(uint32_t bits) {
        if (bits > kFineBits) return;
        done_ = std::min(done_ + 1, level_ * kPerLevel + kPerLevel);
        tell();
    }
    void level_done(uint32_t bits) {
        if (bits > kFineBits) return;
        done_ = ++level_ * kPerLevel;
        tell();
    }

  private:
    static constexpr int kPerLevel = 3 * kStepsPerStrength;
    void tell() const {
        if (report_) report_(double(done_) / (levels_ * kPerLevel + kFinalSteps));
    }

    int levels_, level_ = 0, done_ = 0;
    const std::function<void(double)>& report_;
};

/// The paths that train, and those that judge.
std::pair<std::vector<uint32_t>, std::vector<uint32_t>> divide(const GammaDataset& data, const GammaOptions& options) {
    // A light sub-path with paths in both parts would confirm itself; therefore whole batches judge where there are
    // enough of them. Where there are few, camera samples judge. Those of a guided round then still share light
    // sub-paths with paths that train, and the prior comes out weaker.
    constexpr uint32_t kFewBatches = 5;
    uint32_t batches = 0;
    for (const GammaPath& p : data.paths) batches = std::max(batches, p.batch + 1);
    std::pair<std::vector<uint32_t>, std::vector<uint32_t>> parts;
    for (uint32_t x = 0; x < data.paths.size(); ++x) {
        const double batch = data.paths[x].batch;
        const uint64_t h = mix64(options.seed ^ mix64(data.paths[x].sample + 0x51ull));
        const bool judges = batches < kFewBatches
                                ? double(h >> 11) * 0x1p-53 < options.held_out
                                : std::floor((batch + 1) * options.held_out) > std::floor(batch * options.held_out);
        (judges ? parts.second : parts.first).push_back(x);
    }
    return parts;
}

std::vector<float> train_mm(const GammaDataset& data, const GammaOptions& options, GammaReport* report) {
    const auto [train, judge] = divide(data, options);
    std::vector<uint32_t> all(data.paths.size());
    std::iota(all.begin(), all.end(), 0u);

    // Levels go from about 16 subspaces a side to the finest; each halves the subspaces' size.
    uint32_t bits = 0;
    while ((std::max(data.light_count, data.eye_count) >> bits) > 16) ++bits;
    Steps steps(bits, options.progress);
    LevelProblem problem(data, bits, options.mix);
    std::vector<float> prior = problem.flat_prior(), b = prior;
    report->uniform_loss = problem.loss(prior, judge);
    double best_loss = report->uniform_loss;
    std::vector<double> room;
    int tried = int(std::size(kStrengths)) / 2;  // index of the strength that the last level took
    while (true) {
        const bool finest = bits == 0;
        std::vector<float> best_b = prior;
        double level_loss = HUGE_VAL, strength = 0;
        const auto try_strength = [&](double lambda) {
            std::vector<float> candidate = b;
            for (int i = 0; i < (bits > kFineBits ? kCoarseSteps : kStepsPerStrength) && !options.stop.stop_requested(); ++i) {
                problem.improve(&candidate, prior, lambda, train, &room);
                steps.done_on(bits);
            }
            const double loss = problem.loss(candidate, judge);
            const bool better = loss < level_loss;
            if (better) level_loss = loss, strength = lambda, best_b = std::move(candidate);
            return better;
        };
        if (bits > kFineBits) {
            try_strength(kCoarseStrength);
        } else {
            // The best strength of one level is near that of the level before, and the loss has one minimum in between.
            const int begin = tried;
            try_strength(kStrengths[begin]);
            for (const int way : {-1, 1}) {
                int next = begin + way;
                while (next >= 0 && next < int(std::size(kStrengths)) && try_strength(kStrengths[next])) tried = next, next += way;
                if (tried != begin) break;
            }
        }
        if (options.stop.stop_requested()) return b;
        steps.level_done(bits);
        if (level_loss < best_loss) {
            best_loss = level_loss;
            report->prior_strength = strength;
            report->light_resolution = problem.level().light_count;
            report->eye_resolution = problem.level().eye_count;
            b = std::move(best_b);
            // Once the choice is made, the paths that judged may train as well.
            if (finest)
                for (int i = 0; i < kFinalSteps && !options.stop.stop_requested(); ++i) {
                    problem.improve(&b, prior, strength, all, &room);
                    steps.done_on(bits);
                }
        } else {
            b = prior;  // The data do not support finer subspaces: the coarser model is kept.
        }
        if (finest) break;
        --bits;
        LevelProblem fine(data, bits, options.mix);
        b = prior = fine.lifted(problem, b);
        problem = std::move(fine);
    }
    report->loss = best_loss;
    return problem.mixed(b);
}

std::vector<float> train_adam(const GammaDataset& data, const GammaOptions& options) {
    constexpr double kRate = 0.1, kBeta1 = 0.9, kBeta2 = 0.999, kEpsilon = 1e-8;
    constexpr size_t kBatch = 10000;
    constexpr int kEpochs = 2;
    const LevelProblem problem(data, 0, options.mix);
    std::vector<float> b = problem.flat_prior();
    // The gradient of columns that no path uses is never written and stays zero.
    std::vector<double> theta(b.size()), first(b.size(), 0), second(b.size(), 0), g(b.size(), 0), column_exp(data.light_count);
    for (size_t c = 0; c < b.size(); ++c) theta[c] = math::log(double(b[c]));
    std::vector<uint32_t> order(data.paths.size());
    std::iota(order.begin(), order.end(), 0u);
    Rng rng({options.seed, Stage::kTraining, 2, 0});
    double power1 = 1, power2 = 1;
    for (int epoch = 0; epoch < kEpochs; ++epoch) {
        for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[size_t(rng.next_u64() % i)]);
        for (size_t begin = 0; begin < order.size(); begin += kBatch) {
            if (options.stop.stop_requested()) return b;
            const size_t end = std::min(order.size(), begin + kBatch);
            if (options.progress) options.progress((epoch + double(begin) / double(order.size())) / kEpochs);
            problem.gradient(b, &order[begin], order.data() + end, &g);
            power1 *= kBeta1, power2 *= kBeta2;
            const double scale = 1 / double(end - begin);
            for (uint32_t j = 0; j < data.eye_count; ++j) {
                const size_t column = size_t(j) * data.light_count;
                double mean = 0;
                for (size_t c = column; c < column + data.light_count; ++c) mean += double(b[c]) * g[c];
                double largest = -HUGE_VAL;
                for (size_t c = column; c < column + data.light_count; ++c) {
                    const double slope = -scale * double(b[c]) * (g[c] - mean);  // through the softmax
                    first[c] = kBeta1 * first[c] + (1 - kBeta1) * slope;
                    second[c] = kBeta2 * second[c] + (1 - kBeta2) * slope * slope;
                    theta[c] -= kRate * (first[c] / (1 - power1)) / (std::sqrt(second[c] / (1 - power2)) + kEpsilon);
                    largest = std::max(largest, theta[c]);
                }
                double sum = 0;
                for (size_t i = 0; i < data.light_count; ++i) sum += column_exp[i] = math::exp(theta[column + i] - largest);
                for (size_t i = 0; i < data.light_count; ++i) b[column + i] = float(column_exp[i] / sum);
            }
        }
    }
    return problem.mixed(b);
}

std::vector<float> train_contribution(const GammaDataset& data, const GammaOptions& options) {
    constexpr float kCap = 10;  // relative to the block's brightness: one outlier must not own a column
    const LevelProblem problem(data, 0, options.mix);
    std::vector<double> sum(problem.size(), 0.0);
    for (const GammaPath& p : data.paths) {
        for (uint32_t n = p.first_node; n < p.first_node + p.node_count; ++n)
            sum[size_t(data.nodes[n].eye) * data.light_count + data.nodes[n].light] += double(std::min(p.contribution, kCap));
    }
    std::vector<float> b = problem.flat_prior();
    for (uint32_t j = 0; j < data.eye_count; ++j) {
        const size_t column = size_t(j) * data.light_count;
        double total = 0;
        for (size_t c = column; c < column + data.light_count; ++c) total += sum[c];
        if (!(total > 0)) continue;
        for (size_t c = column; c < column + data.light_count; ++c) b[c] = float(sum[c] / total);
    }
    return problem.mixed(b);
}

double path_loss(const GammaDataset& data, const std::vector<float>& gamma, size_t x) {
    const GammaPath& p = data.paths[x];
    double f = double(p.fixed);
    for (uint32_t n = p.first_node; n < p.first_node + p.node_count; ++n)
        f += double(data.nodes[n].g) * double(gamma[size_t(data.nodes[n].eye) * data.light_count + data.nodes[n].light]);
    return f > 0 ? double(p.weight) / f : 0;
}

}  // namespace

double gamma_loss(const GammaDataset& data, const std::vector<float>& gamma, size_t first, size_t stride) {
    double sum = 0;
    size_t count = 0;
    for (size_t x = first; x < data.paths.size(); x += stride, ++count) sum += path_loss(data, gamma, x);
    return count ? sum / double(count) : 0;
}

double held_out_loss(const GammaDataset& data, const std::vector<float>& gamma, const GammaOptions& options) {
    double sum = 0;
    const std::vector<uint32_t> judge = divide(data, options).second;
    for (const uint32_t x : judge) sum += path_loss(data, gamma, x);
    return judge.empty() ? 0 : sum / double(judge.size());
}

std::vector<float> train_gamma(const GammaDataset& data, const GammaOptions& options, GammaReport* report) {
    *report = {};
    if (options.trainer == GammaTrainer::kMm) return train_mm(data, options, report);
    const LevelProblem problem(data, 0, options.mix);
    report->uniform_loss = gamma_loss(data, problem.mixed(problem.flat_prior()));
    const std::vector<float> gamma =
        options.trainer == GammaTrainer::kAdam ? train_adam(data, options) : train_contribution(data, options);
    report->loss = gamma_loss(data, gamma);
    report->light_resolution = data.light_count, report->eye_resolution = data.eye_count;
    return gamma;
}

}  // namespace lightloom
