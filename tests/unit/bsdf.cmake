lightloom_test(bsdf_test LINK lt_scene)
lightloom_test(bsdf_sampling_test LINK lt_scene)
lightloom_test(material_test LINK lt_scene)
