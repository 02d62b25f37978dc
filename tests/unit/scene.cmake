lightloom_test(scene_test LINK lt_scene)
lightloom_test(noise_test LINK lt_scene)
