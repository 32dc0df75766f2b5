// A plug-in for qemu-user: counts the instructions that the emulated program executes and says so at its end,
// in all or, with the argument functions=on, by function too. Exact for a program of one thread.
//   c++ -std=c++20 -shared -fPIC -O2 -o count_instructions.so count_instructions.cpp
//   qemu-aarch64 -plugin count_instructions.so[,functions=on] -d plugin -L SYSROOT PROGRAM
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

// What is used of QEMU's plug-in interface, version 1; its header is in no Debian package.
struct qemu_info_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
using qemu_plugin_id_t = std::uint64_t;
extern "C" {
enum qemu_plugin_op { QEMU_PLUGIN_INLINE_ADD_U64 };
std::size_t qemu_plugin_tb_n_insns(const qemu_plugin_tb* block);
qemu_plugin_insn* qemu_plugin_tb_get_insn(const qemu_plugin_tb* block, std::size_t index);
const char* qemu_plugin_insn_symbol(const qemu_plugin_insn* instruction);
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t, void (*)(qemu_plugin_id_t, qemu_plugin_tb*));
void qemu_plugin_register_vcpu_tb_exec_inline(qemu_plugin_tb*, qemu_plugin_op, void* counter,
                                              std::uint64_t add);
void qemu_plugin_register_atexit_cb(qemu_plugin_id_t, void (*)(qemu_plugin_id_t, void*), void* data);
void qemu_plugin_outs(const char* text);
}

namespace {

bool by_function = false;
std::uint64_t all = 0;
// By function, each in a place of its own: the emulated code holds the address.
std::unordered_map<std::string, std::unique_ptr<std::uint64_t>> counts;

// A block of code is translated once, before it runs for the first time.
void translated(qemu_plugin_id_t, qemu_plugin_tb* block) {
    const std::size_t instructions = qemu_plugin_tb_n_insns(block);
    std::uint64_t* counter = &all;
    if (by_function) {
        const char* const name = qemu_plugin_insn_symbol(qemu_plugin_tb_get_insn(block, 0));
        std::unique_ptr<std::uint64_t>& count = counts[name != nullptr ? name : "(in libraries)"];
        if (!count) count = std::make_unique<std::uint64_t>(0);
        counter = count.get();
    }
    qemu_plugin_register_vcpu_tb_exec_inline(block, QEMU_PLUGIN_INLINE_ADD_U64, counter, instructions);
}

void ended(qemu_plugin_id_t, void*) {
    std::vector<std::pair<std::uint64_t, std::string>> lines;
    for (const auto& [name, count] : counts) {
        all += *count;
        lines.emplace_back(*count, name);
    }
    std::sort(lines.rbegin(), lines.rend());
    std::string text = "instructions: " + std::to_string(all) + "\n";
    for (const auto& [count, name] : lines)
        text += "function " + std::to_string(count) + " " + name + "\n";
    qemu_plugin_outs(text.c_str());
}

}  // namespace

extern "C" {
[[gnu::visibility("default")]] extern const int qemu_plugin_version = 1;

[[gnu::visibility("default")]] int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t*, int count,
                                                       char** arguments) {
    for (int i = 0; i < count; ++i) {
        const std::string_view argument = arguments[i];
        if (argument == "functions=on" || argument == "functions=off") {
            by_function = argument == "functions=on";
        } else {
            std::fprintf(stderr,
                         "count_instructions does not know '%s'; it takes functions=on or functions=off.\n",
                         arguments[i]);
            return -1;
        }
    }
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, ended, nullptr);
    return 0;
}
}
