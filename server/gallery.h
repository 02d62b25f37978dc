#pragma once
// The desk where images are handed out: finished ones, those of jobs that render, and what is kept of jobs that ended early. See
// JobService for the errors.

#include "server/office.h"

namespace lightloom {

class Gallery {
  public:
    explicit Gallery(Office& office) : office_(office) {}

    Result<std::string> image(const std::string& job_id, ImageKind kind) const;
    Result<Preview> preview(const std::string& job_id, PreviewFormat format, double exposure) const;
    /// Waits a moment where the groups of a job are being written.
    Result<std::string> manifest(const std::string& job_id, ManifestKind kind) const;

  private:
    Office& office_;
    /// Held before the book is opened. One preview is made at a time, because each takes the memory of several images.
    mutable Mutex preview_mutex_;
};

}  // namespace lightloom
