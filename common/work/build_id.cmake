# cmake -DROOT=... -DLIST=... -DVERSION=... -DTOOLS=... -DOUT=... -P build_id.cmake
# LIST: a file that names the sources, a line each, relative to ROOT.
file(STRINGS ${LIST} sources)
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
