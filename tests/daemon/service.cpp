#include "daemon/service.hpp"

#include <fcntl.h>
#include <linux/capability.h>
#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace groundline::test {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

void receive(const lcm_recv_buf_t* from, const char* channel, void* inbox) {
    const auto* first = static_cast<const std::uint8_t*>(from->data);
    (*static_cast<std::map<std::string, std::vector<Receiver::Bytes>>*>(inbox))[channel].emplace_back(
        first, first + from->data_size);
}

}  // namespace

bool eventually(const std::function<bool()>& so) {
    const auto end = Clock::now() + milliseconds(kPatienceMs);
    while (!so()) {
        if (Clock::now() > end) return false;
        std::this_thread::sleep_for(milliseconds(5));
    }
    return true;
}

Service::Service(const Start& start) {
    const std::string address = folder_.at("notify");
    const int notify = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    address.copy(name.sun_path, sizeof name.sun_path - 1);
    std::array<int, 2> err{};
    if (bind(notify, reinterpret_cast<const sockaddr*>(&name), sizeof name) != 0 || pipe(err.data()) != 0)
        throw std::runtime_error("no socket or pipe");
    std::vector<char*> arguments{const_cast<char*>("groundlined")};
    for (const std::string& word : start.words)
        arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    struct stat stream {};
    fstat(err[1], &stream);
    const std::string journal = std::to_string(stream.st_dev) + ":" + std::to_string(stream.st_ino);
    if (start.deaf) {
        const std::array<char, 4096> page{};
        fcntl(err[1], F_SETFL, O_NONBLOCK);
        while (write(err[1], page.data(), page.size()) > 0) {
        }
        fcntl(err[1], F_SETFL, 0);
    }
    pid_ = fork();
    if (pid_ == 0) {
        setenv("NOTIFY_SOCKET", address.c_str(), 1);
        unsetenv("WATCHDOG_PID");
        if (start.watchdog_us > 0) setenv("WATCHDOG_USEC", std::to_string(start.watchdog_us).c_str(), 1);
        if (start.journal) setenv("JOURNAL_STREAM", journal.c_str(), 1);
        if (!start.url.empty()) setenv("LCM_DEFAULT_URL", start.url.c_str(), 1);
        for (const auto& [variable, value] : start.environment)
            setenv(variable.c_str(), value.c_str(), 1);
        if (start.unprivileged) {
            for (const unsigned long right : {CAP_SYS_NICE, CAP_IPC_LOCK, CAP_SYS_RESOURCE})
                prctl(PR_CAPBSET_DROP, right, 0, 0, 0);
            const rlimit none{0, 0};
            setrlimit(RLIMIT_RTPRIO, &none);
            setrlimit(RLIMIT_MEMLOCK, &none);
        }
        dup2(err[1], STDERR_FILENO);
        close(err[0]);
        close(err[1]);
        execv(GROUNDLINED_PROGRAM, arguments.data());
        _exit(127);
    }
    close(err[1]);
    listener_ = std::jthread([this, notify, end = err[0], deaf = start.deaf] { listen(notify, end, deaf); });
}

void Service::listen(int notify, int err, bool deaf) {
    // The end of the program is heard in either case.
    const short wanted = deaf ? 0 : POLLIN;
    std::array<pollfd, 2> open{{{err, wanted, 0}, {notify, POLLIN, 0}}};
    while (open[0].fd >= 0) {
        if (poll(open.data(), open.size(), -1) < 0) continue;
        std::array<char, 4096> buffer{};
        if (open[1].revents != 0) {
            const ssize_t got = recv(notify, buffer.data(), buffer.size(), MSG_DONTWAIT);
            const std::scoped_lock lock(mutex_);
            if (got > 0) told_.emplace_back(buffer.data(), static_cast<std::size_t>(got));
        }
        if (open[0].revents == 0) continue;
        const ssize_t got = read(err, buffer.data(), buffer.size());
        const std::scoped_lock lock(mutex_);
        if (got > 0)
            said_.append(buffer.data(), static_cast<std::size_t>(got));
        else
            open[0].fd = -1;
    }
    close(notify);
    close(err);
}

Service::~Service() {
    if (!ended_) {
        kill(pid_, SIGKILL);
        wait();
    }
}

void Service::signal(int number) const {
    kill(pid_, number);
}

int Service::wait() {
    int status = 0;
    // A thread that was stopped for tracing has to be waited for too before the program has ended.
    if (!eventually([&] { return waitpid(-1, &status, WNOHANG | __WALL) == pid_; })) return -1;
    ended_ = true;
    listener_.join();  // what it said is whole
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

double Service::end_ms(int number, int& status) {
    const auto begin = Clock::now();
    signal(number);
    status = wait();
    return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

std::vector<std::string> Service::told() {
    const std::scoped_lock lock(mutex_);
    return told_;
}

int Service::told(const std::string& text) {
    int count = 0;
    for (const std::string& each : told())
        if (each.find(text) != std::string::npos) ++count;
    return count;
}

std::string Service::said() {
    const std::scoped_lock lock(mutex_);
    return said_;
}

std::vector<Service::Thread> Service::threads() const {
    std::vector<Thread> found;
    const std::filesystem::path tasks = "/proc/" + std::to_string(pid_) + "/task";
    for (const auto& task : std::filesystem::directory_iterator(tasks)) {
        std::ifstream comm(task.path() / "comm");
        std::string name;
        if (std::getline(comm, name)) found.push_back({std::stoi(task.path().filename()), name});
    }
    std::sort(found.begin(), found.end(), [](const Thread& a, const Thread& b) { return a.id < b.id; });
    return found;
}

Service::Stopped::Stopped(pid_t thread) : thread_(thread) {
    if (ptrace(PTRACE_SEIZE, thread_, nullptr, nullptr) != 0) return;
    ptrace(PTRACE_INTERRUPT, thread_, nullptr, nullptr);
    stopped_ = waitpid(thread_, nullptr, __WALL) == thread_;
}

Service::Stopped::Stopped(const Service& service, const std::string& thread)
    : Stopped([&] {
          for (const Thread& each : service.threads())
              if (each.name == thread) return each.id;
          throw std::runtime_error("no thread is named " + thread);
      }()) {}

Service::Stopped::~Stopped() {
    if (stopped_) ptrace(PTRACE_DETACH, thread_, nullptr, nullptr);
}

Receiver::Receiver(const std::string& url) : lcm_(lcm_create(url.c_str())) {
    if (lcm_ != nullptr) lcm_subscribe(lcm_, ".*", receive, &inbox_);
}

Receiver::~Receiver() {
    if (lcm_ != nullptr) lcm_destroy(lcm_);
}

bool Receiver::until(const std::function<bool()>& so, int patience_ms) {
    const auto end = Clock::now() + milliseconds(patience_ms);
    while (!so()) {
        if (Clock::now() > end) return false;
        lcm_handle_timeout(lcm_, 50);
    }
    return true;
}

void Receiver::during(int ms) {
    const auto end = Clock::now() + milliseconds(ms);
    while (Clock::now() < end)
        lcm_handle_timeout(lcm_, 10);
}

bool add_route() {
    return std::system("ip link set lo up && ip route add 224.0.0.0/4 dev lo") == 0;
}

bool remove_route() {
    return std::system("ip route del 224.0.0.0/4 dev lo") == 0;
}

bool own_network() {
    static const bool own = unshare(CLONE_NEWNET) == 0 && add_route();
    return own;
}

std::string lcm_url() {
    return "udpm://239.255.76.67:" + std::to_string(20'000 + getpid() % 20'000) + "?ttl=0";
}

bool multicast_here() {
    static const bool here = [] {
        own_network();  // the network at hand will do as well
        Receiver receiver(lcm_url());
        if (!receiver.good()) return false;
        lcm_t* sender = lcm_create(lcm_url().c_str());
        const std::uint8_t probe = 1;
        bool arrived = false;
        for (int i = 0; i < 20 && !arrived; ++i) {
            lcm_publish(sender, "PROBE", &probe, 1);
            receiver.during(50);
            arrived = !receiver.on("PROBE").empty();
        }
        lcm_destroy(sender);
        return arrived;
    }();
    return here;
}

}  // namespace groundline::test
