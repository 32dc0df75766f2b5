#include "support/interleavings.hpp"

#include <algorithm>
#include <cstddef>

namespace groundline::test {
namespace {

constexpr std::size_t kStackBytes = 64 * 1024;
constexpr std::uint64_t kMostRuns = 5'000'000;

std::uint64_t mixed(std::uint64_t hash, std::uint64_t value) {
    hash ^= value + 0x9E3779B97F4A7C15ULL + (hash << 6U) + (hash >> 2U);
    hash *= 0xFF51AFD7ED558CCDULL;
    return hash ^ (hash >> 33U);
}

struct Fiber {
    ucontext_t context{};
    std::vector<char> stack = std::vector<char>(kStackBytes);
    std::function<void()> body;
    std::uint64_t history = 0;
    const void* asleep_on = nullptr;
    bool ended = false;
};

// A point where more than one thread could go on.
struct Choice {
    std::size_t taken = 0;
    std::size_t of = 0;
};

struct World {
    ucontext_t scheduler{};
    std::vector<std::unique_ptr<Fiber>> fibers;
    Fiber* running = nullptr;
    std::vector<std::uint64_t*> noted;
    std::string fault;
    std::vector<Choice> choices;
    std::unordered_set<std::uint64_t> met;

    std::uint64_t state() const {
        std::uint64_t hash = 1;
        for (const std::uint64_t* value : noted)
            hash = mixed(hash, *value);
        for (const auto& fiber : fibers) {
            hash = mixed(hash, fiber->history);
            hash = mixed(hash, (fiber->ended ? 1U : 0U) + (fiber->asleep_on != nullptr ? 2U : 0U));
        }
        return hash;
    }

    void go_on(Fiber& fiber) {
        running = &fiber;
        swapcontext(&scheduler, &fiber.context);
        running = nullptr;
    }

    // One run along `choices`, which grows where it ends. False where the run met a known state.
    bool run() {
        for (std::size_t depth = 0;;) {
            std::vector<Fiber*> able;
            bool all_ended = true;
            for (const auto& fiber : fibers) {
                all_ended = all_ended && fiber->ended;
                if (!fiber->ended && fiber->asleep_on == nullptr) able.push_back(fiber.get());
            }
            if (!fault.empty()) return true;
            if (able.empty()) {
                if (!all_ended) fault = "every thread that has not ended is asleep: a wake-up was lost";
                return true;
            }
            if (able.size() == 1) {
                go_on(*able[0]);
                continue;
            }
            if (depth == choices.size()) {
                if (!met.insert(state()).second) return false;
                choices.push_back({0, able.size()});
            }
            go_on(*able[choices[depth++].taken]);
        }
    }

    // The next in order, or false where all were tried.
    bool advance() {
        while (!choices.empty() && choices.back().taken + 1 == choices.back().of)
            choices.pop_back();
        if (choices.empty()) return false;
        ++choices.back().taken;
        return true;
    }
};

World* world = nullptr;

void start_fiber() {
    Fiber& fiber = *world->running;
    fiber.body();
    fiber.ended = true;
    swapcontext(&fiber.context, &world->scheduler);
}

}  // namespace

Interleavings::Result Interleavings::explore(
    const std::function<std::vector<std::function<void()>>()>& prepare,
    const std::function<void()>& finally) {
    World here;
    world = &here;
    Result result;
    do {
        here.noted.clear();
        here.fibers.clear();
        for (std::function<void()>& body : prepare()) {
            auto fiber = std::make_unique<Fiber>();
            fiber->body = std::move(body);
            getcontext(&fiber->context);
            fiber->context.uc_stack.ss_sp = fiber->stack.data();
            fiber->context.uc_stack.ss_size = fiber->stack.size();
            makecontext(&fiber->context, start_fiber, 0);
            here.fibers.push_back(std::move(fiber));
        }
        ++result.runs;
        if (here.run() && here.fault.empty()) finally();
        if (result.runs == kMostRuns) here.fault = "too many orders to try them all";
    } while (here.fault.empty() && here.advance());
    result.states = here.met.size();
    result.fault = here.fault;
    world = nullptr;
    return result;
}

void Interleavings::step() {
    if (world == nullptr || world->running == nullptr) return;  // while a run is prepared or judged
    Fiber& fiber = *world->running;
    fiber.history = mixed(fiber.history, 0x57E9);
    swapcontext(&fiber.context, &world->scheduler);
}

void Interleavings::read(std::uint64_t value) {
    if (world != nullptr && world->running != nullptr)
        world->running->history = mixed(world->running->history, value);
}

void Interleavings::note(std::uint64_t* value) {
    if (world != nullptr) world->noted.push_back(value);
}

void Interleavings::sleep(const void* on) {
    Fiber& fiber = *world->running;
    fiber.asleep_on = on;
    swapcontext(&fiber.context, &world->scheduler);
}

void Interleavings::wake(const void* on) {
    for (const auto& fiber : world->fibers)
        if (fiber->asleep_on == on) {
            fiber->asleep_on = nullptr;
            return;
        }
}

void Interleavings::fault(const std::string& sentence) {
    if (world != nullptr && world->fault.empty()) world->fault = sentence;
}

}  // namespace groundline::test
