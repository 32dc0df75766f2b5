#include "daemon/threads.hpp"

#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

namespace groundline::daemon {

bool a_thread_is_stopped() {
    std::error_code fault;
    std::filesystem::directory_iterator task("/proc/self/task", fault);
    for (; !fault && task != std::filesystem::directory_iterator(); task.increment(fault)) {
        std::ifstream stat(task->path() / "stat");
        std::string line;
        if (!std::getline(stat, line)) continue;  // it has just ended
        // "ID (NAME) STATE ...", and a name may hold brackets.
        const std::size_t name_end = line.rfind(") ");
        if (name_end == std::string::npos) continue;
        const char state = line[name_end + 2];
        if (state == 'T' || state == 't') return true;
    }
    return false;
}

}  // namespace groundline::daemon
