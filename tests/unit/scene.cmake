lightloom_test(scene_test LINK lt_scene)
lightloom_test(bump_test LINK lt_scene lt_import)
lightloom_test(noise_test LINK lt_scene)
