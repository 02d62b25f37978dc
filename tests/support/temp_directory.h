#pragma once
// A directory that goes with the object.

#include <stdlib.h>

#include <filesystem>
#include <string>
#include <system_error>

namespace lightloom::testing {

struct TempDirectory {
    TempDirectory() {
        std::string name = (std::filesystem::temp_directory_path() / "lightloom-test-XXXXXX").string();
        path = ::mkdtemp(name.data());
    }
    ~TempDirectory() {
        std::error_code ignored;
        std::filesystem::remove_all(path, ignored);
    }
    TempDirectory(const TempDirectory&) = delete;
    std::string file(const std::string& name) const { return (path / name).string(); }

    std::filesystem::path path;
};

}  // namespace lightloom::testing
