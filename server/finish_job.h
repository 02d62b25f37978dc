#pragma once
// The desk at which a job ends well: its image and manifest are written.

#include "server/office.h"

namespace lightloom {

/// Starts to write the image if there is nothing left to render.
void finish_if_complete(Office& office, OpenBook& book, const JobPtr& file);

}  // namespace lightloom
