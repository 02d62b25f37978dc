# What `cmake --install` and the Debian package hold: the programs, their manual pages (if help2man is there) and completion for
# bash and zsh, README, licences, an example scene and systemd units. Pages and completion come from the built programs when they
# are installed, so they cannot be of an older build.
include(GNUInstallDirs)
install(TARGETS lightloom lightloom-server lightloom-worker RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(FILES LICENSE deploy/copyright DESTINATION ${CMAKE_INSTALL_DOCDIR})
# As in the tree, so that their links lead somewhere.
foreach(document README.md client/README.md server/README.md server/store/README.md deploy/README.md common/README.md common/path/README.md
        common/import/README.md common/metrics/README.md tests/README.md tests/bench/README.md tests/readme/README.md
        tests/scenes/README.md tests/scenes/pictures/four-algorithms.png)
    cmake_path(GET document PARENT_PATH folder)
    install(FILES ${document} DESTINATION ${CMAKE_INSTALL_DOCDIR}/${folder})
endforeach()
install(FILES tests/scenes/quickstart.pbrt DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples)
install(FILES deploy/systemd/lightloom-server.service deploy/systemd/lightloom-worker.service
        DESTINATION lib/systemd/system)

set(generated ${CMAKE_BINARY_DIR}/generated)
set(bin ${CMAKE_RUNTIME_OUTPUT_DIRECTORY})
find_program(HELP2MAN_PROGRAM help2man)
install(CODE "file(REMOVE_RECURSE \"${generated}\")")
if(HELP2MAN_PROGRAM)
    install(CODE "execute_process(COMMAND \"${CMAKE_SOURCE_DIR}/deploy/man_pages.sh\" \"${bin}\" \"${generated}/man\"
                                  COMMAND_ERROR_IS_FATAL ANY)")
    install(DIRECTORY ${generated}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
else()
    message(STATUS "help2man is not there: manual pages will not be installed")
endif()
foreach(program lightloom lightloom-server lightloom-worker)
    foreach(file bash/${program} zsh/_${program})
        cmake_path(GET file PARENT_PATH shell)
        install(CODE "file(MAKE_DIRECTORY \"${generated}/${shell}\")
execute_process(COMMAND \"${bin}/${program}\" --completion ${shell} OUTPUT_FILE \"${generated}/${file}\"
                COMMAND_ERROR_IS_FATAL ANY)")
    endforeach()
endforeach()
install(DIRECTORY ${generated}/bash/ DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
# Debian's zsh looks into vendor-completions for what packages bring, and into site-functions below /usr/local only.
install(CODE "set(zsh site-functions)
if(CMAKE_INSTALL_PREFIX MATCHES \"(^|/)usr$\" AND EXISTS /etc/debian_version)
    set(zsh vendor-completions)
endif()
file(INSTALL \"${generated}/zsh/\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR}/zsh/\${zsh}\")")

# cpack in the build directory makes the package; deploy/package.sh builds first.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME lightloom)
set(CPACK_PACKAGE_VENDOR Lightloom)
set(CPACK_PACKAGE_CONTACT "Lightloom project <lightloom@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "distributed renderer for scenes whose light is hard to find")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION "Lightloom renders pbrt-v4 scenes to OpenEXR images by path, light, bidirectional and learned
bidirectional path tracing, on one machine or with a coordinator and many workers. Every host renders the same bytes.
.
The package holds the client (lightloom), the coordinator (lightloom-server) and the worker (lightloom-worker), and
systemd units for the latter two, which are disabled at first. It needs a processor with AVX2 (x86-64-v3).")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
    WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
# Draws the charts of `lightloom report`.
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "gnuplot-nox")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "bash-completion, man-db")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${CMAKE_SOURCE_DIR}/deploy/debian/postinst ${CMAKE_SOURCE_DIR}/deploy/debian/prerm)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION TRUE)
set(CPACK_SOURCE_GENERATOR "")
include(CPack)
