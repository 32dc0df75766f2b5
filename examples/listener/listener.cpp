// listener [URL]: hears groundline's masks and prints a line for each: how a robot's controller does it.
#include <cstdio>
#include <lcm/lcm-cpp.hpp>
#include <vector>

#include "groundline/mask_decoder.hpp"
#include "groundline/mask_t.hpp"

namespace {

class Listener {
  public:
    void hear(const lcm::ReceiveBuffer*, const std::string&, const groundline::mask_t* mask) {
        // Wrong data gives no classes, and a blind verdict no traversable ones: either way, do not drive.
        if (!groundline::decode_mask(*mask, classes_)) {
            std::puts("a mask that is none");
            return;
        }
        long count[4] = {};
        for (const unsigned char id : classes_)
            ++count[id];
        std::printf("frame %lld, verdict %d: unknown %ld, traversable %ld, obstacle %ld, drop %ld\n",
                    static_cast<long long>(mask->sequence), mask->verdict, count[0], count[1], count[2],
                    count[3]);
        std::fflush(stdout);
    }

  private:
    std::vector<unsigned char> classes_;
};

}  // namespace

int main(int argc, char** argv) {
    lcm::LCM lcm(argc > 1 ? argv[1] : "udpm://239.255.76.67:7667?ttl=0");
    if (!lcm.good()) {
        std::fputs("LCM cannot be opened\n", stderr);
        return 1;
    }
    Listener listener;
    lcm.subscribe("GROUNDLINE_MASK", &Listener::hear, &listener);
    while (lcm.handle() == 0) {
    }
    return 0;
}
