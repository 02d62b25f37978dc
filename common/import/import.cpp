#include "common/import/import.h"

#include <new>

#include "common/import/importer.h"
#include "common/import/parser.h"

namespace lightloom {
namespace import {

Result<ImportedScene> import_from(FileSource* files, const std::string& name, const ImportOptions& options) try {
    Context context(files, options);
    Parser(&context).parse_main(name);
    const Location main{context.intern_file_name(name), 0};
    if (!context.has_pixel_filter)
        context.diagnostics.warn(main,
                                 "there is no PixelFilter, so pbrt would use a gaussian; a box of radius 0.5 is used, "
                                 "the picture is a little sharper");
    resolve_shapes(&context);
    const float exposure = context.film_exposure_time.value_or(context.exposure_time) * context.iso / 100;
    if (!(exposure >= 0 && exposure <= kMaxCoordinate))
        fail(main, "iso and the exposure time multiply the picture by more than 1e15; lower them");
    context.scene.film.response = {double(exposure), context.film_colour};
    LL_RETURN_IF_ERROR(validate(context.scene));
    context.scene.warnings = context.diagnostics.messages();
    return ImportedScene{std::move(context.scene), files->files()};
} catch (const ImportFailure& failure) {
    return failure.status;
} catch (const std::bad_alloc&) {
    return Status(StatusCode::kResourceExhausted, name + ": the scene does not fit into memory");
}

}  // namespace import

Result<ImportedScene> import_pbrt(const std::string& path, const ImportOptions& options) {
    const size_t slash = path.rfind('/');
    const std::string root = slash == std::string::npos ? "" : slash == 0 ? "/" : path.substr(0, slash);
    const std::string name = slash == std::string::npos ? path : path.substr(slash + 1);
    if (name.empty()) return invalid_argument("the scene path \"" + path + "\" names a directory; give the .pbrt file");
    import::DirectorySource files(root, options.max_file_bytes);
    return import::import_from(&files, name, options);
}

}  // namespace lightloom
