// Testbench: executes the commands of a job file on the Verilated device, one command per line.
//
//   load FILE BYTES TARGET   loads words of BYTES bytes to a target, from address 0; records (target 0) are written
//                            directly into the column memories
//   stream FILE BYTES TARGET loads words through the load port, one per cycle
//   write ADDRESS VALUE      writes one register word
//   frame FILE WIDTH HEIGHT START WATCHDOG  starts a frame by a write to register START, waits for its end, and
//                            writes its pixels (struct PixelBytes, row by row); WATCHDOG is in cycles, 0 for none;
//                            prints "simulated CYCLES SECONDS", of the processor, and for designs with a cache
//                            "value dram.beats N", the beats of its DRAM port
//   read NAME ADDRESS WORDS  prints "value NAME VALUE"
//
// Options: --stall PERCENT of cycles in which the pixel sink is not ready; --seed N; for designs with memory stalls:
// --memory PERCENT of cycles in which each bank is stalled, --burst N, the longest stall in cycles;
// for designs with a cache: --dram N, the latency of DRAM in cycles, --dram-interval N, --dram-banks N, --dram-random
// PERCENT, --dram-errors N, --dram-silent N (dram.hpp);
// --check N: checks the coupling of the models (array.hpp) in every Nth cycle.
// --deaf 1: a fault for tests: models that are not evaluated since they stand still do not hear their inputs.
// --awake 1: models that stand still are evaluated too.
// With WAVEFORM defined, --waveform FILE writes the signals of the frames as VCD; the time unit is a cycle.
// Progress goes to standard error as "progress SHARE". Exit status 0, or 3 on an error.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iostream>
#include <iterator>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "array.hpp"
// EACH_COLUMN(DO): DO(column) for each column. If the design has them: HIT_DISTANCE(column) of the hit,
// HAS_INSTANCES, RATIO(column, channel), the shadow ratio, and MEMORY_BANKS, the number of banks of all columns.
#include "ports.hpp"
#include "dram.hpp"

namespace {

#pragma pack(push, 1)
struct PixelBytes {
    std::uint16_t colour[3], ratio[3];
    std::uint8_t isObject, isSeen;
    std::uint32_t triangle, instance;
    double distance;
};
#pragma pack(pop)

template <class Port> double numberOf(const Port& port) {
    unsigned __int128 value = 0;
    static_assert(sizeof(Port) <= sizeof value, "a distance of more than 128 bits");
    std::memcpy(&value, &port, sizeof port);
    return static_cast<double>(value);
}

/// Maximum cycles from the watchdog's last expiry to the end of the frame, and expiries: an abort, and the end of
/// waiting for a DRAM that is silent.
constexpr std::uint64_t watchdogMargin = 100'000, watchdogs = 2;

/// A common multiple of the periods of all free-running counters, such as the beats of shared arithmetic units.
constexpr std::uint64_t freePeriods = 840;

struct Options {
    unsigned stallPercent = 0, seed = 1, memoryPercent = 0, memoryBurst = 32, checkInterval = 64, deaf = 0, awake = 0;
    std::string waveform;
    DramOptions dram;
};

#ifdef MEMORY_BANKS
/// Stalls each bank independently, in bursts of random length, in `percent` of all cycles.
class BankStalls {
public:
    explicit BankStalls(const Options& options)
        : random_(options.seed), percent_(options.memoryPercent), burst_(1, options.memoryBurst) {
        const double stalled = percent_ / 100.0, length = (1.0 + options.memoryBurst) / 2.0;
        starts_ = std::bernoulli_distribution(percent_ == 0 ? 0.0 : 1.0 / (1.0 + length * (1.0 - stalled) / stalled));
    }

    /// Sets the stall bits of the next cycle.
    template <class Port> void next(Port& port) {
        if (percent_ == 0) return;
        unsigned char bits[sizeof(Port)] = {};
        for (unsigned bank = 0; bank < MEMORY_BANKS; ++bank) {
            unsigned& left = left_[bank];
            if (left == 0 && starts_(random_)) left = burst_(random_);
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
    std::bernoulli_distribution starts_;
    unsigned left_[MEMORY_BANKS] = {};
};
#endif

class Harness {
public:
    explicit Harness(const Options& options)
        : array_(options.deaf != 0), random_(options.seed), stallPercent_(options.stallPercent),
          checkInterval_(std::max(1u, options.checkInterval))
#ifdef MEMORY_BANKS
          ,
          stalls_(options)
#endif
#ifdef DRAM_BUS_BYTES
          ,
          dram_(top_, options.dram)
#endif
    {
#ifndef MEMORY_BANKS
        if (options.memoryPercent != 0) throw std::runtime_error("this design cannot stall its memory");
#endif
#ifdef WAVEFORM
        if (!options.waveform.empty()) {
            Verilated::traceEverOn(true);
            array_.addTo(waveform_);
            waveform_.open(options.waveform.c_str());
            if (!waveform_.isOpen()) throw std::runtime_error("the waveform cannot be written");
        }
#else
        if (!options.waveform.empty()) throw std::runtime_error("this simulator was built without waveforms");
#endif
        if (options.awake != 0) array_.stayAwake();
        top_.reset = 1;
        for (int i = 0; i < 8; ++i) cycle();
        top_.reset = 0;
        cycle();
    }

    /// Loads the words of a file to consecutive addresses of a target, from 0. Words of targets other than the column
    /// memories (target 0) may be narrower than the port.
    ///
    /// The path tracers are idle during a load. So records take no cycles, and other words only cycles of device and
    /// columns. Extra cycles then bring free-running counters to the same state as a load through the port.
    void load(const std::string& file, std::size_t bytes, std::uint64_t target, bool throughPort) {
        const std::size_t port = sizeof top_.io_load_bits_record;
        if (target == 0 ? bytes != port : bytes > port)
            throw std::runtime_error("the words do not have the width of the load port");
        if (!top_.io_load_ready) throw std::runtime_error("the load port is not ready");
        std::ifstream stream(file, std::ios::binary);
        if (!stream) throw std::runtime_error("no file " + file);
        std::vector<char> word(bytes);
        std::uint64_t address = 0;
        for (; stream.read(word.data(), static_cast<std::streamsize>(bytes)); ++address) {
#ifdef DRAM_BUS_BYTES
            if (target == 0) {
                dram_.store(address, word.data(), bytes);
                continue;
            }
#endif
            if (target == 0 && !throughPort) {
                array_.store(address, word.data(), bytes);
                continue;
            }
            top_.io_load_valid = 1;
            top_.io_load_bits_target = static_cast<std::uint8_t>(target);
            top_.io_load_bits_address = static_cast<std::uint32_t>(address);
            std::memset(&top_.io_load_bits_record, 0, port);
            std::memcpy(&top_.io_load_bits_record, word.data(), bytes);
            if (throughPort) cycle();
            else array_.outerCycle();
        }
        top_.io_load_valid = 0;
        if (throughPort) return;
        for (std::uint64_t left = address % freePeriods; left != 0; --left) {
            if (target == 0) cycle();
            else array_.unitsEdge(true);
        }
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
            value |= static_cast<unsigned __int128>(top_.io_register_readData) << (32 * word);
        }
        return value;
    }

    void frame(const std::string& file, std::size_t width, std::size_t height, std::uint64_t startAddress,
               std::uint64_t watchdog) {
        pixels_.assign(width * height, {});
        width_ = width;
        received_ = 0;
        isTraced_ = true;
        write(startAddress, 1);
        const std::clock_t begun = std::clock();
        const std::uint64_t first = cycles_;
#ifdef DRAM_BUS_BYTES
        const std::uint64_t firstBeat = dram_.beats();
#endif
        auto lastReport = std::chrono::steady_clock::now();
        quiet_ = 0;
        mayChangeRegisters_ = false;
        while (!top_.io_done) {
#ifdef MEMORY_BANKS
            stalls_.next(top_.io_memoryHolds);
#endif
            cycle();
            if (watchdog != 0 && quiet_ > watchdogs * watchdog + watchdogMargin)
                throw std::runtime_error("the watchdog did not abort the frame in time");
            if ((cycles_ & 0xff) == 0 &&
                std::chrono::steady_clock::now() - lastReport > std::chrono::milliseconds(250)) {
                lastReport = std::chrono::steady_clock::now();
                std::cerr << "progress " << static_cast<double>(received_) / static_cast<double>(pixels_.size())
                          << std::endl;
            }
        }
#ifdef MEMORY_BANKS
        std::memset(&top_.io_memoryHolds, 0, sizeof top_.io_memoryHolds);
#endif
#ifdef DRAM_BUS_BYTES
        dram_.stopFailing();
#endif
        mayChangeRegisters_ = true;
        // The waveform includes the cycle in which `done` is high
        if (traces()) cycle();
        isTraced_ = false;
        const double seconds = static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC;
        std::ofstream(file, std::ios::binary)
            .write(reinterpret_cast<const char*>(pixels_.data()),
                   static_cast<std::streamsize>(pixels_.size() * sizeof(PixelBytes)));
        std::cout << "simulated " << cycles_ - first << ' ' << seconds << '\n';
#ifdef DRAM_BUS_BYTES
        std::cout << "value dram.beats " << dram_.beats() - firstBeat << '\n';
#endif
    }

private:
    /// One clock cycle; accepts the pixels that are valid in it.
    void cycle() {
        const bool takes = stallPercent_ == 0 || random_() % 100 >= stallPercent_;
#define OFFER(column) top_.io_pixels_##column##_ready = takes;
        EACH_COLUMN(OFFER)
#undef OFFER
#ifdef DRAM_BUS_BYTES
        dram_.offer();
#endif
        array_.settle();
#ifdef DRAM_BUS_BYTES
        dram_.take();
#endif
        quiet_ += takes;
#define TAKE(column) \
    if (takes && top_.io_pixels_##column##_valid) { \
        PixelBytes& pixel = at(top_.io_pixels_##column##_bits_x, top_.io_pixels_##column##_bits_y); \
        pixel.colour[0] = top_.io_pixels_##column##_bits_colour_r; \
        pixel.colour[1] = top_.io_pixels_##column##_bits_colour_g; \
        pixel.colour[2] = top_.io_pixels_##column##_bits_colour_b; \
        pixel.isObject = top_.io_pixels_##column##_bits_isObject; \
        TAKE_RATIO(column) \
        TAKE_HIT(column) \
    }
#ifdef RATIO
#define TAKE_RATIO(column) \
    pixel.ratio[0] = RATIO(column, r); \
    pixel.ratio[1] = RATIO(column, g); \
    pixel.ratio[2] = RATIO(column, b);
#else
#define TAKE_RATIO(column)
#endif
#ifdef HIT_DISTANCE
#define TAKE_HIT(column) \
    pixel.triangle = top_.io_pixels_##column##_bits_hit_triangle; \
    pixel.distance = numberOf(HIT_DISTANCE(column)); \
    TAKE_INSTANCE(column)
#else
#define TAKE_HIT(column)
#endif
#ifdef HAS_INSTANCES
#define TAKE_INSTANCE(column) pixel.instance = top_.io_pixels_##column##_bits_hit_instance;
#else
#define TAKE_INSTANCE(column)
#endif
        EACH_COLUMN(TAKE)
#undef TAKE
        if (cycles_ % checkInterval_ == 0) array_.check();
#ifdef WAVEFORM
        if (traces()) {
            array_.settleTraced();
            waveform_.dump(cycles_);
        }
#endif
        array_.edge(mayChangeRegisters_);
        ++cycles_;
    }

    /// Whether the waveform includes this cycle.
    bool traces() const {
#ifdef WAVEFORM
        return isTraced_ && waveform_.isOpen();
#else
        return false;
#endif
    }

    PixelBytes& at(std::size_t x, std::size_t y) {
        if (x >= width_ || y * width_ + x >= pixels_.size()) throw std::runtime_error("a pixel lies outside the frame");
        PixelBytes& pixel = pixels_[y * width_ + x];
        if (pixel.isSeen) throw std::runtime_error("a pixel arrived twice");
        pixel.isSeen = 1;
        ++received_;
        quiet_ = 0;
        return pixel;
    }

    Array array_;
    VColonnade& top_ = array_.device;
    std::mt19937 random_;
    unsigned stallPercent_, checkInterval_;
    bool mayChangeRegisters_ = true, isTraced_ = false;
#ifdef WAVEFORM
    VerilatedVcdC waveform_;
#endif
#ifdef MEMORY_BANKS
    BankStalls stalls_;
#endif
#ifdef DRAM_BUS_BYTES
    Dram<VColonnade> dram_;
#endif
    std::uint64_t cycles_ = 0;
    /// Cycles since the last pixel in which the sink was ready.
    std::uint64_t quiet_ = 0;
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
        std::uint64_t a = 0, b = 0, c = 0, d = 0;
        words >> command;
        if ((command == "load" || command == "stream") && words >> name >> a >> b)
            harness.load(name, a, b, command == "stream");
        else if (command == "write" && words >> a >> b) harness.write(a, static_cast<std::uint32_t>(b));
        else if (command == "frame" && words >> name >> a >> b >> c >> d) harness.frame(name, a, b, c, d);
        else if (command == "read" && words >> name >> a >> b)
            std::cout << "value " << name << ' ' << decimal(harness.read(a, static_cast<unsigned>(b))) << '\n';
        else throw std::runtime_error("unknown command: " + line);
    }
}

} // namespace

int main(int argc, char** argv) try {
    std::string job;
    Options options;
    const std::pair<const char*, unsigned*> named[] = {{"--stall", &options.stallPercent},
                                                       {"--seed", &options.seed},
                                                       {"--memory", &options.memoryPercent},
                                                       {"--burst", &options.memoryBurst},
                                                       {"--check", &options.checkInterval},
                                                       {"--deaf", &options.deaf},
                                                       {"--awake", &options.awake},
                                                       {"--dram", &options.dram.latency},
                                                       {"--dram-interval", &options.dram.interval},
                                                       {"--dram-banks", &options.dram.banks},
                                                       {"--dram-random", &options.dram.randomPercent},
                                                       {"--dram-errors", &options.dram.errorsPer1024},
                                                       {"--dram-silent", &options.dram.silentAfter}};
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        const auto option =
            std::find_if(std::begin(named), std::end(named), [&](const auto& one) { return argument == one.first; });
        if (argument == "--waveform" && i + 1 < argc) options.waveform = argv[++i];
        else if (option == std::end(named)) job = argument;
        else if (++i < argc) *option->second = static_cast<unsigned>(std::stoul(argv[i]));
        else throw std::runtime_error(argument + " needs a number");
    }
    options.dram.seed = options.seed;
    run(job, options);
    return 0;
} catch (const std::exception& problem) {
    std::cerr << "harness: " << problem.what() << '\n';
    return 3;
}
