lightloom_test(bsdf_test LINK lt_scene)
lightloom_test(bsdf_sampling_test LINK lt_scene)
lightloom_test(material_test LINK lt_scene)
lightloom_test(bsdf_layers_test LINK lt_scene)
lightloom_test(opacity_test LINK lt_scene)
lightloom_test(coat_tables_test LINK lt_scene)

# g++ 12 sees an overlapping copy in std::string's operator+ that cannot happen (GCC bug 105651).
foreach(test bsdf_test bsdf_sampling_test bsdf_layers_test)
    target_compile_options(${test} PRIVATE -Wno-restrict)
endforeach()
