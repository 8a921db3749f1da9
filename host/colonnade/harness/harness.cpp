// Runs the generated hardware under Verilator: carries out the commands of a job file, one a line.
//
//   load FILE BYTES TARGET   words of BYTES bytes each, through the load port, to consecutive addresses of a target
//   write ADDRESS VALUE      one register word
//   frame FILE WIDTH HEIGHT START  starts a frame by a write to register START, waits for its end, writes its pixels
//                            (struct PixelBytes, row by row)
//   read NAME ADDRESS WORDS  prints "value NAME VALUE"
//
// Options: --stall PERCENT (of the cycles in which the pixel sink does not take pixels), --seed N; where the memory can
// be held: --memory PERCENT (of a frame's cycles in which each bank is held), --burst N (longest hold, cycles).
// Progress goes to standard error as "progress SHARE". Exit status 0, or 3 when the hardware misbehaves.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "VColonnade.h"
#include "columns.hpp" // EACH_COLUMN(DO): DO(column) for each column; HIT_DISTANCE(column) where the stream carries hits,
                       // RATIO(column, channel) where it carries the light left to a room; MEMORY_BANKS, of all columns, where they can be held
#include "verilated.h"

namespace {

#pragma pack(push, 1)
struct PixelBytes {
    std::uint16_t colour[3], ratio[3];
    std::uint8_t isObject, isSeen;
    std::uint32_t triangle;
    double distance;
};
#pragma pack(pop)

template <class Port> double numberOf(const Port& port) {
    unsigned __int128 value = 0;
    static_assert(sizeof(Port) <= sizeof value, "a distance of more than 128 bits");
    std::memcpy(&value, &port, sizeof port);
    return static_cast<double>(value);
}

struct Options {
    unsigned stallPercent = 0, seed = 1, memoryPercent = 0, memoryBurst = 32;
};

#ifdef MEMORY_BANKS
/// Holds each bank on its own: for a random number of cycles, at random, so that it is held in `percent` of all cycles.
class BankHolds {
public:
    explicit BankHolds(const Options& options) : random_(options.seed), percent_(options.memoryPercent), burst_(1, options.memoryBurst) {
        const double held = percent_ / 100.0, length = (1.0 + options.memoryBurst) / 2.0;
        begins_ = std::bernoulli_distribution(percent_ == 0 ? 0.0 : 1.0 / (1.0 + length * (1.0 - held) / held));
    }

    /// The bits of the next cycle.
    template <class Port> void next(Port& port) {
        if (percent_ == 0) return;
        unsigned char bits[sizeof(Port)] = {};
        for (unsigned bank = 0; bank < MEMORY_BANKS; ++bank) {
            unsigned& left = left_[bank];
            if (left == 0 && begins_(random_)) left = burst_(random_);
            if (left == 0) continue;
            --left;
            bits[bank / 8] |= static_cast<unsigned char>(1u << (bank % 8));
        }
        std::memcpy(&port, bits, sizeof bits);
    }

private:
    std::mt19937 random_;
    unsigned percent_;
    std::uniform_int_distribution<unsigned> burst_;
    std::bernoulli_distribution begins_;
    unsigned left_[MEMORY_BANKS] = {};
};
#endif

class Harness {
public:
    explicit Harness(const Options& options)
        : random_(options.seed), stallPercent_(options.stallPercent)
#ifdef MEMORY_BANKS
        , holds_(options)
#endif
    {
#ifndef MEMORY_BANKS
        if (options.memoryPercent != 0) throw std::runtime_error("this hardware's memory cannot be held");
#endif
        top_.reset = 1;
        for (int i = 0; i < 8; ++i) cycle();
        top_.reset = 0;
        cycle();
    }
    ~Harness() { top_.final(); }

    /// Words for a memory other than that of the columns (target 0) may be narrower than the port.
    void load(const std::string& file, std::size_t bytes, std::uint64_t target) {
        std::ifstream stream(file, std::ios::binary);
        std::vector<char> record(bytes);
        for (std::uint64_t address = 0; stream.read(record.data(), static_cast<std::streamsize>(bytes)); ++address) {
            const std::size_t port = sizeof top_.io_load_bits_record;
            if (target == 0 ? bytes != port : bytes > port) throw std::runtime_error("records of another width than the load port's");
            top_.io_load_valid = 1;
            top_.io_load_bits_target = static_cast<std::uint8_t>(target);
            top_.io_load_bits_address = static_cast<std::uint32_t>(address);
            std::memset(&top_.io_load_bits_record, 0, port);
            std::memcpy(&top_.io_load_bits_record, record.data(), bytes);
            for (int wait = 0; !ready(top_.io_load_ready); ++wait) {
                if (wait > 1000) throw std::runtime_error("the load port takes no records");
                cycle();
            }
            cycle();
        }
        top_.io_load_valid = 0;
    }

    void write(std::uint64_t address, std::uint32_t value) {
        top_.io_register_write = 1;
        top_.io_register_address = static_cast<std::uint32_t>(address);
        top_.io_register_writeData = value;
        cycle();
        top_.io_register_write = 0;
    }

    unsigned __int128 read(std::uint64_t address, unsigned words) {
        unsigned __int128 value = 0;
        for (unsigned word = 0; word < words; ++word) {
            top_.io_register_read = 1;
            top_.io_register_address = static_cast<std::uint32_t>(address + word);
            cycle();
            top_.io_register_read = 0;
            top_.eval();
            value |= static_cast<unsigned __int128>(top_.io_register_readData) << (32 * word);
        }
        return value;
    }

    void frame(const std::string& file, std::size_t width, std::size_t height, std::uint64_t startAddress) {
        pixels_.assign(width * height, {});
        width_ = width;
        received_ = 0;
        write(startAddress, 1);
        const auto begun = std::chrono::steady_clock::now();
        const std::uint64_t first = cycles_;
        auto shown = begun;
        std::uint64_t quiet = 0;
        for (std::size_t before = 0; !ready(top_.io_done); before = received_) {
#ifdef MEMORY_BANKS
            holds_.next(top_.io_memoryHolds);
#endif
            cycle();
            quiet = received_ == before ? quiet + 1 : 0;
            if (quiet > 2'000'000'000) throw std::runtime_error("no pixel in two thousand million cycles");
            if ((cycles_ & 0xff) == 0 && std::chrono::steady_clock::now() - shown > std::chrono::milliseconds(250)) {
                shown = std::chrono::steady_clock::now();
                std::cerr << "progress " << static_cast<double>(received_) / static_cast<double>(pixels_.size()) << std::endl;
            }
        }
#ifdef MEMORY_BANKS
        std::memset(&top_.io_memoryHolds, 0, sizeof top_.io_memoryHolds);
#endif
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begun;
        std::ofstream(file, std::ios::binary).write(reinterpret_cast<const char*>(pixels_.data()), static_cast<std::streamsize>(pixels_.size() * sizeof(PixelBytes)));
        std::cout << "simulated " << cycles_ - first << ' ' << seconds.count() << '\n';
    }

private:
    template <class Signal> bool ready(const Signal& signal) {
        top_.eval();
        return signal != 0;
    }

    /// One clock cycle; takes the pixels that are offered in it.
    void cycle() {
        const bool takes = stallPercent_ == 0 || random_() % 100 >= stallPercent_;
#define OFFER(column) top_.io_pixels_##column##_ready = takes;
        EACH_COLUMN(OFFER)
#undef OFFER
        top_.clock = 0;
        top_.eval();
#define TAKE(column)                                                                                                                      \
    if (takes && top_.io_pixels_##column##_valid) {                                                                                       \
        PixelBytes& pixel = at(top_.io_pixels_##column##_bits_x, top_.io_pixels_##column##_bits_y);                                       \
        pixel.colour[0] = top_.io_pixels_##column##_bits_colour_r;                                                                        \
        pixel.colour[1] = top_.io_pixels_##column##_bits_colour_g;                                                                        \
        pixel.colour[2] = top_.io_pixels_##column##_bits_colour_b;                                                                        \
        pixel.isObject = top_.io_pixels_##column##_bits_isObject;                                                                         \
        TAKE_RATIO(column)                                                                                                                \
        TAKE_HIT(column)                                                                                                                  \
    }
#ifdef RATIO
#define TAKE_RATIO(column)                                                                                                                \
    pixel.ratio[0] = RATIO(column, r);                                                                                                    \
    pixel.ratio[1] = RATIO(column, g);                                                                                                    \
    pixel.ratio[2] = RATIO(column, b);
#else
#define TAKE_RATIO(column)
#endif
#ifdef HIT_DISTANCE
#define TAKE_HIT(column)                                                                                                                  \
    pixel.triangle = top_.io_pixels_##column##_bits_hit_triangle;                                                                         \
    pixel.distance = numberOf(HIT_DISTANCE(column));
#else
#define TAKE_HIT(column)
#endif
        EACH_COLUMN(TAKE)
#undef TAKE
        top_.clock = 1;
        top_.eval();
        ++cycles_;
    }

    PixelBytes& at(std::size_t x, std::size_t y) {
        if (x >= width_ || y * width_ + x >= pixels_.size()) throw std::runtime_error("a pixel outside the frame");
        PixelBytes& pixel = pixels_[y * width_ + x];
        if (pixel.isSeen) throw std::runtime_error("a pixel came twice");
        pixel.isSeen = 1;
        ++received_;
        return pixel;
    }

    VColonnade top_;
    std::mt19937 random_;
    unsigned stallPercent_;
#ifdef MEMORY_BANKS
    BankHolds holds_;
#endif
    std::uint64_t cycles_ = 0;
    std::vector<PixelBytes> pixels_;
    std::size_t width_ = 0, received_ = 0;
};

std::string decimal(unsigned __int128 value) {
    std::string digits;
    do digits.insert(digits.begin(), static_cast<char>('0' + static_cast<int>(value % 10)));
    while (value /= 10);
    return digits;
}

void run(const std::string& job, const Options& options) {
    Harness harness(options);
    std::ifstream commands(job);
    for (std::string line; std::getline(commands, line);) {
        std::istringstream words(line);
        std::string command, name;
        std::uint64_t a = 0, b = 0, c = 0;
        words >> command;
        if (command == "load" && words >> name >> a) harness.load(name, a, words >> b ? b : 0);
        else if (command == "write" && words >> a >> b) harness.write(a, static_cast<std::uint32_t>(b));
        else if (command == "frame" && words >> name >> a >> b >> c) harness.frame(name, a, b, c);
        else if (command == "read" && words >> name >> a >> b) std::cout << "value " << name << ' ' << decimal(harness.read(a, static_cast<unsigned>(b))) << '\n';
        else throw std::runtime_error("not a command: " + line);
    }
}

} // namespace

int main(int argc, char** argv) try {
    std::string job;
    Options options;
    const std::pair<const char*, unsigned*> named[] = {
        {"--stall", &options.stallPercent}, {"--seed", &options.seed}, {"--memory", &options.memoryPercent}, {"--burst", &options.memoryBurst}};
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        const auto option = std::find_if(std::begin(named), std::end(named), [&](const auto& one) { return argument == one.first; });
        if (option == std::end(named)) job = argument;
        else if (++i < argc) *option->second = static_cast<unsigned>(std::stoul(argv[i]));
        else throw std::runtime_error(argument + " without a number");
    }
    run(job, options);
    return 0;
} catch (const std::exception& problem) {
    std::cerr << "harness: " << problem.what() << '\n';
    return 3;
}
