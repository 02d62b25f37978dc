lightloom_test(sampling_test LINK lt_scene)
lightloom_test(camera_test LINK lt_scene)
lightloom_test(emitter_test LINK lt_scene)
lightloom_test(weights_test LINK lt_transport)
lightloom_test(transport_test LINK lt_transport)
lightloom_test(allocation_test LINK lt_transport)
lightloom_test(large_scene_test LINK lt_transport lt_import)

add_test(NAME light_math_symbols
         COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/light_math_symbols.sh $<TARGET_FILE:lt_core> $<TARGET_FILE:lt_scene_base>
                 $<TARGET_FILE:lt_scene> $<TARGET_FILE:lt_tables> $<TARGET_FILE:lt_import> $<TARGET_FILE:lt_transport>)
set(libraries "")
foreach(name core cli scene_base scene film import tables transport work server worker client)
    list(APPEND libraries $<TARGET_FILE:lt_${name}>)
endforeach()
add_test(NAME one_definition COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/one_definition.sh ${libraries})
