// Runs the program `groundlined` as a service manager would, and keeps what it says on each channel.
#pragma once

#include <lcm/lcm.h>
#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "replay/program.hpp"

namespace groundline::test {

// No test here waits longer for anything; all of it comes within a second on an idle machine.
inline constexpr int kPatienceMs = 30'000;

// Asks until it is so or kPatienceMs have passed.
bool eventually(const std::function<bool()>& so);

struct Start {
    std::vector<std::string> words;
    std::int64_t watchdog_us = 0;
    bool journal = false;  // stderr says that it is the journal's
    std::string url = {};  // LCM_DEFAULT_URL
    std::vector<std::pair<std::string, std::string>> environment = {};
    bool deaf = false;          // nobody reads stderr, and its pipe is full
    bool unprivileged = false;  // without the right to real time and to lock memory
};

class Service {
  public:
    explicit Service(const Start& start);
    // Ends the program by SIGKILL if it still runs.
    ~Service();
    Service(const Service&) = delete;
    Service& operator=(const Service&) = delete;

    pid_t pid() const { return pid_; }
    void signal(int number) const;
    // Waits for the end; exit status, or 128 + signal, or -1 where it does not end.
    int wait();
    // Milliseconds from the signal to the end.
    double end_ms(int number, int& status);

    struct Thread {
        pid_t id;
        std::string name;
    };
    // Its threads now, in the order in which they were started.
    std::vector<Thread> threads() const;
    // What came over NOTIFY_SOCKET so far, one datagram each.
    std::vector<std::string> told();
    // How many of those contain `text`.
    int told(const std::string& text);
    // stderr so far.
    std::string said();
    bool says(const std::string& text) { return said().find(text) != std::string::npos; }

    // A thread, stopped as a debugger does until the object ends.
    class Stopped {
      public:
        explicit Stopped(pid_t thread);
        Stopped(const Service& service, const std::string& thread);
        ~Stopped();
        Stopped(const Stopped&) = delete;
        Stopped& operator=(const Stopped&) = delete;
        bool stopped() const { return stopped_; }

      private:
        pid_t thread_ = 0;
        bool stopped_ = false;
    };

  private:
    void listen(int notify, int err, bool deaf);

    Folder folder_;
    pid_t pid_ = -1;
    bool ended_ = false;
    std::mutex mutex_;
    std::vector<std::string> told_;
    std::string said_;
    std::jthread listener_;
};

// Every message received, by channel, in order.
class Receiver {
  public:
    using Bytes = std::vector<std::uint8_t>;

    explicit Receiver(const std::string& url);
    ~Receiver();
    Receiver(const Receiver&) = delete;
    Receiver& operator=(const Receiver&) = delete;

    bool good() const { return lcm_ != nullptr; }
    // Takes what comes until it is so or that time has passed.
    bool until(const std::function<bool()>& so, int patience_ms = kPatienceMs);
    // Takes what comes for that long.
    void during(int ms);
    const std::vector<Bytes>& on(const std::string& channel) { return inbox_[channel]; }
    void forget() { inbox_.clear(); }

    template <typename Message>
    bool send(const std::string& channel, const Message& message) {
        Bytes bytes(static_cast<std::size_t>(message.getEncodedSize()));
        message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
        return lcm_publish(lcm_, channel.c_str(), bytes.data(), static_cast<unsigned>(bytes.size())) == 0;
    }

    template <typename Message>
    Message last(const std::string& channel) {
        Message message{};
        if (const auto& all = inbox_[channel]; !all.empty())
            message.decode(all.back().data(), 0, static_cast<int>(all.back().size()));
        return message;
    }

  private:
    lcm_t* lcm_;
    std::map<std::string, std::vector<Bytes>> inbox_;
};

// A network of this process's own where that is permitted, with a multicast route on lo. False where no
// multicast is to be had.
bool multicast_here();
bool own_network();
// Of that network.
bool remove_route();
bool add_route();
std::string lcm_url();

}  // namespace groundline::test
