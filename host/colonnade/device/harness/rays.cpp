// Testbench of a device for rays: executes commands from standard input, one per line, on the Verilated device.
//
//   load COUNT BYTES         then COUNT records of BYTES bytes: loads them, from address 0
//   write ADDRESS VALUE      writes one register word
//   read ADDRESS             prints a register word
//   batch TAIL IN OUT        then a batch and IN bytes of its rays: puts it into the only place of the ring, writes 1
//                            to the register TAIL more
//                            than the last one, waits for its end, and prints its tag and OUT bytes of hits
//
// A batch has its rays at 1 << 32, its hits at 2 << 32 and its tag at 64; the ring is at 0. Options: --dram N, the
// latency of both memories in cycles, --random PERCENT of cycles in which nothing moves, --seed N. Exit status 0, or 3
// on an error.
#include <deque>
#include <iostream>
#include <random>
#include <sstream>
#include <vector>

#include "array.hpp"
#include "ports.hpp"
#include "dram.hpp"

namespace {

constexpr unsigned beatBytes = 64, checkInterval = 64;
constexpr std::uint64_t patience = 1'000'000, doneAddress = 64;

/// The memory of batches, rays and hits: 4 GB each from a region's begin, of which only what is in use exists.
class RayMemory {
public:
    RayMemory(VColonnade& top, const DramOptions& options) : top_(top), options_(options), random_(options.seed) {
        regions_[0].resize(2 * beatBytes);
    }

    std::vector<unsigned char>& region(unsigned number) { return regions_[number]; }
    bool isIdle() const { return reads_.empty() && answers_.empty() && writeBeats_ == 0; }

    /// Sets the inputs of the port for this cycle, before the device settles.
    void offer() {
        ++now_;
        top_.io_read_ar_ready = moves();
        top_.io_write_aw_ready = writeBeats_ == 0 && moves();
        top_.io_write_w_ready = writeBeats_ != 0 && moves();
        if (!offersRead_) offerRead();
        if (!offersAnswer_ && !answers_.empty() && answers_.front().due <= now_ && moves()) {
            offersAnswer_ = true;
            top_.io_write_b_bits_id = answers_.front().id;
            top_.io_write_b_bits_resp = 0;
        }
        top_.io_read_r_valid = offersRead_;
        top_.io_write_b_valid = offersAnswer_;
    }

    /// Takes the transfers of this cycle, after the device has settled; its inputs stay for the clock edge.
    void take() {
        if (top_.io_read_r_valid && top_.io_read_r_ready) {
            offersRead_ = false;
            reads_.front().address += beatBytes;
            if (--reads_.front().beats == 0) reads_.pop_front();
        }
        if (top_.io_write_b_valid && top_.io_write_b_ready) {
            offersAnswer_ = false;
            answers_.pop_front();
        }
        if (top_.io_read_ar_valid && top_.io_read_ar_ready)
            reads_.push_back({top_.io_read_ar_bits_addr, top_.io_read_ar_bits_len + 1u,
                              static_cast<unsigned>(top_.io_read_ar_bits_id), now_ + options_.latency});
        if (top_.io_write_w_valid && top_.io_write_w_ready) store();
        if (top_.io_write_aw_valid && top_.io_write_aw_ready) {
            write_ = {top_.io_write_aw_bits_addr, 0, static_cast<unsigned>(top_.io_write_aw_bits_id), 0};
            writeBeats_ = top_.io_write_aw_bits_len + 1u;
        }
    }

private:
    struct Burst {
        std::uint64_t address;
        unsigned beats, id;
        std::uint64_t due;
    };

    bool moves() { return options_.randomPercent == 0 || random_() % 100 >= options_.randomPercent; }

    unsigned char* at(std::uint64_t address) {
        std::vector<unsigned char>& region = regions_[address >> 32 & 3];
        const std::uint64_t offset = address & 0xffffffff;
        return address >> 34 == 0 && offset + beatBytes <= region.size() ? &region[offset] : nullptr;
    }

    void offerRead() {
        if (reads_.empty() || reads_.front().due > now_ || !moves()) return;
        const Burst& read = reads_.front();
        const unsigned char* const data = at(read.address);
        if (data) std::memcpy(&top_.io_read_r_bits_data, data, beatBytes);
        offersRead_ = true;
        top_.io_read_r_bits_id = read.id;
        top_.io_read_r_bits_resp = data ? 0 : 3;
        top_.io_read_r_bits_last = read.beats == 1;
    }

    void store() {
        unsigned char* const to = at(write_.address);
        if (!to) throw std::runtime_error("a write beyond the memory");
        unsigned char data[beatBytes];
        std::memcpy(data, &top_.io_write_w_bits_data, beatBytes);
        for (unsigned i = 0; i < beatBytes; ++i)
            if (top_.io_write_w_bits_strb >> i & 1) to[i] = data[i];
        write_.address += beatBytes;
        if (--writeBeats_ == 0) answers_.push_back({0, 0, write_.id, now_ + options_.latency});
    }

    VColonnade& top_;
    DramOptions options_;
    std::mt19937 random_;
    std::vector<unsigned char> regions_[4];
    std::deque<Burst> reads_, answers_;
    Burst write_{};
    bool offersRead_ = false, offersAnswer_ = false;
    unsigned writeBeats_ = 0;
    std::uint64_t now_ = 0;
};

class Harness {
public:
    explicit Harness(const DramOptions& options)
        : memory_(top_, options)
#ifdef DRAM_BUS_BYTES
          ,
          dram_(top_, options)
#endif
    {
        top_.reset = 1;
        for (int i = 0; i < 8; ++i) cycle(true);
        top_.reset = 0;
        cycle(true);
    }

    void load(std::size_t count, std::size_t bytes) {
        const std::vector<char> records = input(count * bytes);
        if (bytes != sizeof top_.io_load_bits_record)
            throw std::runtime_error("the records do not have the width of the load port");
        for (std::size_t address = 0; address < count; ++address) {
#ifdef DRAM_BUS_BYTES
            dram_.store(address, &records[address * bytes], bytes);
#else
            array_.store(address, &records[address * bytes], bytes);
#endif
        }
    }

    void write(std::uint64_t address, std::uint32_t value) {
        top_.io_register_write = 1;
        top_.io_register_address = static_cast<std::uint32_t>(address);
        top_.io_register_writeData = value;
        cycle(true);
        top_.io_register_write = 0;
    }

    std::uint32_t read(std::uint64_t address) {
        top_.io_register_read = 1;
        top_.io_register_address = static_cast<std::uint32_t>(address);
        cycle(true);
        top_.io_register_read = 0;
        return top_.io_register_readData;
    }

    void batch(std::uint64_t tail, std::size_t in, std::size_t out) {
        const std::vector<char> batch = input(beatBytes), rays = input(in);
        std::memcpy(memory_.region(0).data(), batch.data(), beatBytes);
        memory_.region(1).assign((in / beatBytes + 1) * beatBytes, 0);
        std::memcpy(memory_.region(1).data(), rays.data(), in);
        memory_.region(2).assign((out / beatBytes + 1) * beatBytes, 0);
        write(tail, ++batches_ & 0xffff);
        std::uint64_t left = patience + 1000 * out;
        do cycle(false);
        while (--left != 0 && (!top_.io_done || !memory_.isIdle()));
        if (left == 0) throw std::runtime_error("the batch does not end");
        std::uint32_t tag;
        std::memcpy(&tag, &memory_.region(0)[doneAddress], sizeof tag);
        std::cout << tag << '\n';
        std::cout.write(reinterpret_cast<const char*>(memory_.region(2).data()), static_cast<std::streamsize>(out));
    }

private:
    void cycle(bool mayChangeRegisters) {
        memory_.offer();
#ifdef DRAM_BUS_BYTES
        dram_.offer();
#endif
        array_.settle();
        memory_.take();
#ifdef DRAM_BUS_BYTES
        dram_.take();
#endif
        if (cycles_++ % checkInterval == 0) array_.check();
        array_.edge(mayChangeRegisters);
    }

    static std::vector<char> input(std::size_t bytes) {
        std::vector<char> result(bytes);
        if (!std::cin.read(result.data(), static_cast<std::streamsize>(bytes)))
            throw std::runtime_error("the input ends");
        return result;
    }

    Array array_;
    VColonnade& top_ = array_.device;
    RayMemory memory_;
#ifdef DRAM_BUS_BYTES
    Dram<VColonnade> dram_;
#endif
    std::uint64_t cycles_ = 0, batches_ = 0;
};

void run(const DramOptions& options) {
    Harness harness(options);
    for (std::string line; std::getline(std::cin, line); std::cout.flush()) {
        std::istringstream words(line);
        std::string command;
        std::uint64_t a = 0, b = 0, c = 0;
        words >> command >> a;
        if (command == "load" && words >> b) harness.load(a, b);
        else if (command == "write" && words >> b) harness.write(a, static_cast<std::uint32_t>(b));
        else if (command == "read") std::cout << harness.read(a) << '\n';
        else if (command == "batch" && words >> b >> c) harness.batch(a, b, c);
        else throw std::runtime_error("unknown command: " + line);
    }
}

} // namespace

int main(int argc, char** argv) try {
    DramOptions options;
    for (int i = 1; i + 1 < argc; i += 2) {
        const std::string name = argv[i];
        unsigned& value = name == "--dram"     ? options.latency
                          : name == "--random" ? options.randomPercent
                                               : options.seed;
        value = static_cast<unsigned>(std::stoul(argv[i + 1]));
    }
    run(options);
    return 0;
} catch (const std::exception& problem) {
    std::cerr << "harness: " << problem.what() << '\n';
    return 3;
}
