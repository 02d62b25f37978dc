# cmake -DROOT=... -DVERSION=... -DTOOLS=... -DOUT=... -P build_id.cmake
file(GLOB_RECURSE sources RELATIVE ${ROOT} ${ROOT}/common/*.h ${ROOT}/common/*.cpp)
list(FILTER sources EXCLUDE REGEX "^common/cli/")  # computes no light
list(SORT sources)
set(text "")
foreach(source ${sources})
    file(SHA256 ${ROOT}/${source} digest)
    string(APPEND text "${digest} ${source}\n")
endforeach()
string(SHA256 digest "${text}")
string(SUBSTRING ${digest} 0 16 short)
file(WRITE ${OUT} "#include \"common/work/identity.h\"
namespace lightloom {
const char* const kBuildId = \"${VERSION}+${short}\";
const char* const kTools = \"${TOOLS}\";
}  // namespace lightloom
")
