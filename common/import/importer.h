#pragma once
// The importer on any source of files: what import_pbrt() and import_faults() do on a directory.

#include "common/import/file_source.h"
#include "common/import/import.h"

namespace lightloom::import {

Result<ImportedScene> import_from(FileSource* files, const std::string& name, const ImportOptions& options);
std::vector<std::string> faults_from(FileSource* files, const std::string& name, const ImportOptions& options);

}  // namespace lightloom::import
