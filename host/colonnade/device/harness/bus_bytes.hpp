// The bytes behind the bus of the shell's testbench (shell_memory.hpp).
#pragma once
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

/// Bytes from a bus address on, whose index is the bus address: of this process, where they begin as 0xA5, or of a file
/// that other programs also map.
class BusBytes {
public:
    BusBytes() = default;
    BusBytes(std::uint64_t base, std::uint64_t size, const std::string& file) : base_(base), end_(base + size) {
        begin_ = map(nullptr, end_, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1);
        if (file.empty()) std::memset(begin_ + base_, 0xA5, size);
        else share(file, size);
    }
    BusBytes(const BusBytes&) = delete;
    BusBytes& operator=(const BusBytes&) = delete;
    ~BusBytes() {
        if (end_ != 0) munmap(begin_, end_);
    }

    std::uint64_t size() const { return end_; }
    std::uint8_t& operator[](std::uint64_t address) { return begin_[address]; }

    std::uint8_t* range(std::uint64_t address, std::uint64_t size) {
        if (address < base_ || address > end_ || size > end_ - address)
            throw std::runtime_error("an access beyond the memory");
        return begin_ + address;
    }

private:
    static std::uint8_t* map(void* at, std::uint64_t size, int flags, int file) {
        void* const mapped = size == 0 ? nullptr : mmap(at, size, PROT_READ | PROT_WRITE, flags, file, 0);
        if (mapped == MAP_FAILED) throw std::runtime_error("the memory cannot be mapped");
        return static_cast<std::uint8_t*>(mapped);
    }

    void share(const std::string& name, std::uint64_t size) {
        const int file = open(name.c_str(), O_RDWR);
        struct stat status = {};
        if (file < 0 || fstat(file, &status) != 0) throw std::runtime_error("no file " + name);
        if (static_cast<std::uint64_t>(status.st_size) < size)
            throw std::runtime_error(name + " is smaller than the memory");
        map(begin_ + base_, size, MAP_SHARED | MAP_FIXED, file);
        close(file);
    }

    std::uint64_t base_ = 0, end_ = 0;
    std::uint8_t* begin_ = nullptr;
};
