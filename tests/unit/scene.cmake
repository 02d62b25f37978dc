lightloom_test(scene_test LINK lt_scene)
