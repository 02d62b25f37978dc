# cmake -DROOT=... -DROOTS=... -DLIST=... -DVERSION=... -DTOOLS=... -DOUT=... -P build_id.cmake
# ROOTS: a file that names sources, a line each, relative to ROOT. The id is the digest of these and of the headers under common/
# that they include, directly or not; LIST becomes the list of all of them.
cmake_minimum_required(VERSION 3.25)
file(STRINGS ${ROOTS} open)
set(sources)
while(open)
    list(POP_FRONT open source)
    if(source IN_LIST sources)
        continue()
    endif()
    list(APPEND sources ${source})
    file(STRINGS ${ROOT}/${source} includes REGEX "^#include \"common/")
    foreach(include IN LISTS includes)
        string(REGEX REPLACE "^#include \"([^\"]+)\".*" "\\1" header "${include}")
        list(APPEND open ${header})
    endforeach()
endwhile()
list(SORT sources)

set(text "")
foreach(source ${sources})
    file(SHA256 ${ROOT}/${source} digest)
    string(APPEND text "${digest} ${source}\n")
endforeach()
string(SHA256 digest "${text}")
string(SUBSTRING ${digest} 0 16 short)
list(JOIN sources "\n" lines)
file(CONFIGURE OUTPUT ${LIST} CONTENT "${lines}\n" @ONLY)
# The file is left alone where nothing changed, so that nothing is compiled and linked again after a change elsewhere.
file(CONFIGURE OUTPUT ${OUT} @ONLY CONTENT "#include \"common/work/identity.h\"
namespace lightloom {
const char* const kBuildId = \"${VERSION}+${short}\";
const char* const kTools = \"${TOOLS}\";
}  // namespace lightloom
")
