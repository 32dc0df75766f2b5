// Memory and pictures for tests that render.
#pragma once

#include <cstdint>
#include <cstring>
#include <string_view>
#include <thread>
#include <vector>

#include "core/arena.hpp"
#include "core/parallel.hpp"
#include "synth/renderer.hpp"

namespace groundline::synth::test {

// A renderer with room for one frame and its truth.
struct Studio {
    Renderer renderer;
    Arena arena;
    Luma left, right;
    BgrView left_bgr;
    Truth truth;

    explicit Studio(Scene scene) : renderer(std::move(scene)) {
        const RectifiedRig& rig = renderer.scene().rig;
        left = arena.image<std::uint8_t>(rig.width, rig.height);
        right = arena.image<std::uint8_t>(rig.width, rig.height);
        left_bgr = arena.bgr_image(rig.width, rig.height);
        truth = Truth::make(arena, rig.width, rig.height);
    }
    explicit Studio(std::string_view spec) : Studio(scene_by_name(spec)) {}

    const RectifiedRig& rig() const { return renderer.scene().rig; }
    const Studio& shoot(std::int64_t frame = 0, double tolerance_m = 0.2) {
        Serial serial;
        renderer.render(frame, serial, left, left_bgr, right);
        return look(frame, tolerance_m);
    }
    const Studio& look(std::int64_t frame = 0, double tolerance_m = 0.2) {
        Serial serial;
        renderer.render_truth(frame, serial, tolerance_m, truth);
        return *this;
    }
};

// FNV-1a over the pixels of an image, row by row, without padding.
template <typename T>
std::uint64_t hash_of(ImageView<T> image, std::uint64_t hash = 0xCBF29CE484222325U) {
    for (int y = 0; y < image.height; ++y) {
        const auto* bytes = reinterpret_cast<const unsigned char*>(image.row(y));
        for (std::size_t i = 0; i < static_cast<std::size_t>(image.width) * sizeof(T); ++i)
            hash = (hash ^ bytes[i]) * 0x100000001B3U;
    }
    return hash;
}
inline std::uint64_t hash_of(const BgrView& image) {
    return hash_of(Luma(image.data, 3 * image.width, image.height, image.stride));
}

// Deals the tasks to threads in an order of its own: later rows first, one after the other to each lane.
class Shuffled final : public Parallel {
  public:
    explicit Shuffled(int lanes) : lanes_(lanes) {}
    int lanes() const override { return lanes_; }
    void for_each(int count, FunctionRef<void(int, int)> task) override {
        std::vector<std::jthread> threads;
        for (int lane = 0; lane < lanes_; ++lane)
            threads.emplace_back([=, this] {
                for (int index = count - 1 - lane; index >= 0; index -= lanes_)
                    task(index, lane);
            });
    }

  private:
    int lanes_;
};

}  // namespace groundline::synth::test
