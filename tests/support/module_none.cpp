// A shared object that is no camera driver module at all.
extern "C" int groundline_test_nothing() {
    return 0;
}
