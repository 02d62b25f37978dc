#pragma once
// Crash points: places at which a test can make a program die, to see what the others make of it.
//
//   LIGHTLOOM_CRASH_AT=server.before-merge:3 lightloom-server
//
// kills the coordinator with SIGKILL when it passes the label server.before-merge for the third time. Nothing is flushed, closed or
// told, as after `kill -9` or an exhausted memory. Without the variable a crash point costs one relaxed load.

#include <atomic>
#include <cstdint>
#include <span>
#include <string_view>

#include "common/core/result.h"

namespace lightloom {

/// The variable of the environment: LABEL or LABEL:N. N counts from 1, which is the default.
inline constexpr const char* kCrashVariable = "LIGHTLOOM_CRASH_AT";

/// All labels. What begins with "worker." is passed by workers, what begins with "server." by the coordinator, "asset." and "file."
/// by both. A unit is one of the image or of the training set, unless the label says which.
inline constexpr std::string_view kCrashLabels[] = {
    "worker.registered",         // the coordinator has let it in
    "worker.unit-received",      // a lease arrived; nothing was fetched or rendered for it
    "worker.scene-read",         // the scene's files are fetched and the scene is built
    "worker.unit-rendered",      // a unit of the image is complete
    "worker.training-traced",    // a unit of the training set is complete
    "worker.before-submit",      // before a result is sent, every attempt counts
    "worker.after-submit",       // the coordinator has answered
    "worker.unit-released",      // a unit was given back
    "server.job-kept",           // a job is on disk, nobody knows of it
    "server.job-accepted",       // a job is known, its submitter has no answer yet
    "server.scene-read",         // the scene of a job was read
    "server.units-planned",      // a job may begin to render
    "server.unit-leased",        // a unit was given away, its worker has no answer yet
    "server.result-received",    // all bytes of an image's unit are here, nothing was looked at
    "server.training-received",  // the same for a unit of the training set
    "server.result-kept",        // a result is on disk; nothing was added, its worker has no answer yet
    "server.training-kept",      // the same for a unit of the training set
    "server.checkpoint-kept",    // the sums of an image are on disk
    "server.before-merge",       // a result is valid and the first of its unit; nothing was added
    "server.after-merge",        // it was added, but the job does not count it yet
    "server.result-counted",     // the job counts it, its worker has no answer yet
    "server.training-counted",   // the same for a unit of the training set
    "server.tables-learned",     // the tables of a job are complete, in memory only
    "server.tables-cached",      // they are in the table cache
    "server.tables-stored",      // they are where workers fetch them
    "server.image-encoded",      // the image is complete, in memory only
    "server.image-written",      // the image is on disk, its manifest is not
    "server.manifest-written",   // both are on disk, the job has not ended yet
    "server.partial-written",    // the groups of a job that failed or was cancelled are on disk, its results are, too
    "server.job-ended",          // the job has its last state, nobody was told
    "server.segment-created",    // a file for payloads has its name, and nothing is in it
    "server.payloads-written",   // the payloads of a batch are in their segments, not flushed; the transaction is open
    "server.payloads-synced",    // they are flushed, the transaction is still open
    "server.batch-committed",    // the batch is on disk, nobody was told
    "server.checkpoint-saved",   // a checkpoint's file is on disk, nothing refers to it
    "asset.appended",            // a part of a file has arrived, or all of it
    "asset.before-commit",       // a file is complete, flushed and checked; it has no name yet
    "asset.committed",           // it has its name
    "file.before-rename",        // a file that appears whole is complete and flushed under its temporary name
    "file.after-rename",         // it has its name
};

namespace crash {

extern std::atomic<bool> armed;
/// Counts, and ends the process if it is time to.
[[gnu::cold, gnu::noinline]] void passed(size_t label);

/// An index into kCrashLabels, which the compiler finds: a label that is not there does not compile.
class Label {
  public:
    consteval Label(const char* text) : index_(0) {
        while (kCrashLabels[index_] != std::string_view(text)) ++index_;
    }
    size_t index() const { return index_; }

  private:
    size_t index_;
};

}  // namespace crash

/// A place that has a label.
inline void crash_point(crash::Label label) {
    if (crash::armed.load(std::memory_order_relaxed)) [[unlikely]]
        crash::passed(label.index());
}

/// Arms the crash point that `text` (LABEL or LABEL:N) names, and none if it is empty. Another one that was armed no longer is.
/// An error names what is wrong with the text. To be called before there are threads.
Status arm_crash_point(std::string_view text);
/// The same with what the environment says.
Status arm_crash_point_of_environment();

}  // namespace lightloom
