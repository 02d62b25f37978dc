lightloom_test(sampling_test LINK lt_scene)
lightloom_test(camera_test LINK lt_scene)
lightloom_test(emitter_test LINK lt_scene)
lightloom_test(weights_test LINK lt_transport)
lightloom_test(transport_test LINK lt_transport)
lightloom_test(allocation_test LINK lt_transport)
lightloom_test(large_scene_test LINK lt_transport lt_import)

# Three looks at the object files. The lists of libraries come from what links what: none can be forgotten.
lightloom_light_libraries(light_libraries)
lightloom_all_libraries(all_libraries)
list(TRANSFORM light_libraries REPLACE "(.+)" "$<TARGET_FILE:\\1>" OUTPUT_VARIABLE light_archives)
list(TRANSFORM all_libraries REPLACE "(.+)" "$<TARGET_FILE:\\1>" OUTPUT_VARIABLE all_archives)
add_test(NAME light_math_symbols COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/light_math_symbols.sh ${light_archives})
add_test(NAME light_sources COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/light_sources.sh ${CMAKE_SOURCE_DIR} ${CMAKE_BINARY_DIR}
         $<TARGET_FILE:lt_transport> $<TARGET_FILE:lt_import> -- ${light_archives} -- ${all_archives})
add_test(NAME one_definition COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/one_definition.sh ${all_archives})
