// The simulated device for rays, by the commands of its program (host/colonnade/device/harness/rays.cpp) over its
// standard streams.
#pragma once
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>

#include "device_registers.hpp"

namespace colonnade::rays {

/// File descriptors of a program's streams.
struct Streams {
    int commands, answers, errors;
};

class Simulation {
public:
    /// `registers`: see `DeviceRegisters`. The streams stay the caller's.
    Simulation(const std::string& registers, const Streams& streams) : registers_(registers), streams_(streams) {}

    /// Loads records, and sets the registers of a scene.
    void load(const RegisterValues& values, const std::uint8_t* records, std::size_t count, std::size_t recordBytes) {
        const auto writes = registers_.writesOf(values);
        registers_.keepSums([this](std::uint32_t address) { return read(address); });
        std::string commands = "load " + std::to_string(count) + ' ' + std::to_string(recordBytes) + '\n';
        commands.append(reinterpret_cast<const char*>(records), count * recordBytes);
        for (const auto& [address, word] : writes)
            commands += "write " + std::to_string(address) + ' ' + std::to_string(word) + '\n';
        send(commands);
    }

    /// Runs a batch of `in` bytes of rays, with the addresses of the simulator; writes `out` bytes of hits, and returns
    /// the tag.
    std::uint32_t submit(colonnade_rays_batch batch, const void* rays, std::size_t in, void* hits, std::size_t out) {
        batch.rays = raysAddress;
        batch.hits = hitsAddress;
        batch.done = doneAddress;
        std::string commands = "batch " + std::to_string(registers_.addressOf("rays.tail")) + ' ' + std::to_string(in) +
                               ' ' + std::to_string(out) + '\n';
        commands.append(reinterpret_cast<const char*>(&batch), sizeof batch);
        commands.append(static_cast<const char*>(rays), in);
        send(commands);
        const std::uint32_t tag = number();
        receive(static_cast<char*>(hits), out);
        return tag;
    }

    /// Counters since the device was opened, by name.
    RegisterValues counters() {
        return registers_.sums([this](std::uint32_t address) { return read(address); });
    }

private:
    static constexpr std::uint64_t raysAddress = std::uint64_t{1} << 32, hitsAddress = std::uint64_t{2} << 32,
                                   doneAddress = 64;

    /// Blocks SIGPIPE in this thread: a program that has ended is an error of the call, not the end of this process.
    class WithoutPipeSignal {
    public:
        WithoutPipeSignal() {
            sigemptyset(&pipe_);
            sigaddset(&pipe_, SIGPIPE);
            wasPending_ = isPending();
            pthread_sigmask(SIG_BLOCK, &pipe_, &before_);
        }
        ~WithoutPipeSignal() {
            int number;
            if (!wasPending_ && isPending()) sigwait(&pipe_, &number);
            pthread_sigmask(SIG_SETMASK, &before_, nullptr);
        }
        WithoutPipeSignal(const WithoutPipeSignal&) = delete;

    private:
        static bool isPending() {
            sigset_t pending;
            return sigpending(&pending) == 0 && sigismember(&pending, SIGPIPE) == 1;
        }
        sigset_t pipe_{}, before_{};
        bool wasPending_;
    };

    std::uint32_t read(std::uint32_t address) {
        send("read " + std::to_string(address) + '\n');
        return number();
    }

    void send(const std::string& commands) {
        const WithoutPipeSignal guard;
        for (std::size_t done = 0; done < commands.size();) {
            const ssize_t count = ::write(streams_.commands, commands.data() + done, commands.size() - done);
            if (count > 0) done += static_cast<std::size_t>(count);
            else if (errno != EINTR) fail();
        }
    }

    /// A line with a number.
    std::uint32_t number() {
        std::string line;
        for (char next = 0; receive(&next, 1), next != '\n';) line += next;
        return static_cast<std::uint32_t>(std::stoul(line));
    }

    void receive(char* to, std::size_t size) {
        while (size != 0) {
            if (first_ == last_) fill();
            const std::size_t count = std::min(size, last_ - first_);
            std::memcpy(to, buffer_ + first_, count);
            first_ += count;
            to += count;
            size -= count;
        }
    }

    void fill() {
        const ssize_t count = readSome(streams_.answers);
        if (count <= 0) fail();
        first_ = 0;
        last_ = static_cast<std::size_t>(count);
    }

    ssize_t readSome(int from) {
        ssize_t count;
        do count = ::read(from, buffer_, sizeof buffer_);
        while (count < 0 && errno == EINTR);
        return count;
    }

    /// Throws what the program, which ends, has written to its stream of errors, in one line.
    [[noreturn]] void fail() {
        if (failure_.empty()) {
            std::string text;
            for (ssize_t count; (count = readSome(streams_.errors)) > 0;)
                text.append(buffer_, static_cast<std::size_t>(count));
            while (!text.empty() && text.back() == '\n') text.pop_back();
            std::replace(text.begin(), text.end(), '\n', ' ');
            failure_ = "the simulated hardware failed: " + (text.empty() ? "its program has ended" : text);
            first_ = last_ = 0;
        }
        throw std::runtime_error(failure_);
    }

    DeviceRegisters registers_;
    Streams streams_;
    std::string failure_;
    char buffer_[1 << 14];
    std::size_t first_ = 0, last_ = 0;
};

} // namespace colonnade::rays
