#pragma once
// The name and the owner that a submission states besides what is to be rendered.

#include <string>

#include "common/work/service.h"

namespace lightloom::client {

/// Takes `name`, or the scene file's name without directories and extension where that is empty, and USER@HOST of this process.
JobLabel make_label(const std::string& name, const std::string& scene);

}  // namespace lightloom::client
