#pragma once
// Tables: what an algorithm has learned before it renders, in named parts. The container knows none of the parts: a
// part's type defines its name and how it is written, read and checked, and an algorithm's row of the catalog lists the
// parts that it has.

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/result.h"
#include "common/scene/emitter.h"

namespace lightloom {

/// How parts of one type are handled. A type T declares its own as `static const TablePart kPart`.
struct TablePart {
    std::string_view name;
    std::string (*serialize)(const void* part);
    Result<std::shared_ptr<const void>> (*parse)(std::string_view bytes);
    /// Checks everything that a renderer of a scene with these emitters relies on; kDataLoss names what is wrong.
    Status (*validate)(const void* part, const EmitterSet& emitters);
};

class Tables {
  public:
    Tables() = default;
    template <class T>
    explicit Tables(T part) {
        set(std::make_shared<const T>(std::move(part)));
    }

    /// Replaces the part of that type.
    template <class T>
    void set(std::shared_ptr<const T> part) {
        put(&T::kPart, std::move(part));
    }
    /// The part of type T, or null when there is none.
    template <class T>
    std::shared_ptr<const T> get() const {
        return std::static_pointer_cast<const T>(find(&T::kPart));
    }
    bool empty() const { return parts_.empty(); }
    /// Name of the algorithm that the tables belong to; empty where it is unknown. Parts of the same type may mean
    /// different things to different algorithms.
    const std::string& algorithm() const { return algorithm_; }
    void belong_to(std::string algorithm) { algorithm_ = std::move(algorithm); }
    /// Whether the tables have exactly these parts.
    bool consist_of(std::span<const TablePart* const> parts) const;
    Status validate(const EmitterSet& emitters) const;

  private:
    struct Entry {
        const TablePart* part;
        std::shared_ptr<const void> value;
    };
    void put(const TablePart* part, std::shared_ptr<const void> value);
    std::shared_ptr<const void> find(const TablePart* part) const;

    friend std::string serialize(const Tables& tables);
    friend Result<Tables> parse_tables(std::string_view bytes, std::span<const TablePart* const> known);

    std::vector<Entry> parts_;  // sorted by name
    std::string algorithm_;
};

/// Serialized tables of every version begin with this.
inline constexpr std::string_view kTablesPrefix = "lightloom-tables ";

/// Writes each part with its own SHA-256. The same tables have the same bytes on every host.
std::string serialize(const Tables& tables);
/// kDataLoss when a part is cut short, damaged or malformed; kFailedPrecondition for a part that is not among the known ones.
Result<Tables> parse_tables(std::string_view bytes, std::span<const TablePart* const> known);

}  // namespace lightloom
