#pragma once
// The desk at which a job ends well: its image and manifest are written.

#include "common/core/crash_point.h"
#include "server/office.h"
#include "server/results.h"

namespace lightloom {

/// Starts to write the image if there is nothing left to render.
void finish_if_complete(Office& office, OpenBook& book, const JobPtr& file);

// What images of jobs that end early (keep_groups.h) need as well.

struct FinishedImage {
    std::string bytes;
    Job::Image about;
};
/// The EXR of the groups of a frozen reducer.
Result<FinishedImage> finished_image(const Reducer& reducer, const JobSpec& spec, std::vector<ImageLayer> layers);
/// Enters the counts of the image in the job, and all but what the scene's list says in a manifest.
Manifest settled_manifest(Office& office, const OpenBook& book, const JobPtr& file, const Job::Image& about);
/// Writes both to the job's directory, flushed. With kCancelled if it waited for room in vain.
Status write_image(Office& office, const JobPtr& file, const std::string& image, Manifest manifest, const ImageFileNames& names,
                   crash::Label image_written, WaitsUntil until);

}  // namespace lightloom
