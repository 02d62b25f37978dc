lightloom_test(import_test LINK lt_import)
lightloom_test(import_shapes_test LINK lt_import)
lightloom_test(import_looks_test LINK lt_import)
lightloom_test(import_scenes_test LINK lt_import)
