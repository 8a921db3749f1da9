// A bench of ColonnadeAxi in Verilator: the driver in C on its registers, and a memory behind m_axi. Copy it, and
// replace what your system has: the accesses (Bus), the memory (Memory), the driver's calls (main).
//
// usage: bench IMAGE FRAME OUTPUT [+backdoor=FOLDER]
//
// IMAGE and FRAME come from `colonnade pack`, OUTPUT receives lines of XRGB8888. With +backdoor the records are in the
// column memories already (backdoor.py), and nothing is loaded through the bus.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "VColonnadeAxi.h"
#include "colonnade.h"
#include "colonnade_design.h"

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint64_t kImage = 0x100000, kFramebuffer = 0x8000000; // bus addresses
constexpr unsigned kLatency = 20, kAttempts = 1000, kMostCycles = 100'000'000;

[[noreturn]] void fail(const std::string& what) {
    std::fprintf(stderr, "bench: %s\n", what.c_str());
    std::exit(1);
}

Bytes readFile(const std::string& name) {
    std::ifstream file(name, std::ios::binary);
    if (!file) fail("no file " + name);
    return Bytes(std::istreambuf_iterator<char>(file), {});
}

/// The memory behind m_axi: two ranges of bytes. Answers come in order, kLatency cycles after the address or the last
/// data.
class Memory {
public:
    explicit Memory(VColonnadeAxi& top) : top_(top) {}

    Bytes image, framebuffer;

    /// Sets the inputs of this cycle, before the clock edge.
    void offer() {
        ++now_;
        top_.m_axi_awready = top_.m_axi_wready = top_.m_axi_arready = 1;
        top_.m_axi_bvalid = !answers_.empty() && answers_.front() <= now_;
        top_.m_axi_rvalid = !reads_.empty() && reads_.front().due <= now_;
        if (top_.m_axi_rvalid) {
            const Burst& read = reads_.front();
            for (unsigned i = 0; i < kBytes; ++i) data(top_.m_axi_rdata)[i] = *at(read.address + i);
            top_.m_axi_rlast = read.beats == 1;
        }
        top_.eval();
    }

    /// Takes the transfers of this cycle, after `offer`. Data of a write may come before its address.
    void take() {
        if (top_.m_axi_awvalid) writes_.push_back({top_.m_axi_awaddr, 0, top_.m_axi_awlen + 1u});
        if (top_.m_axi_arvalid) reads_.push_back({top_.m_axi_araddr, now_ + kLatency, top_.m_axi_arlen + 1u});
        if (top_.m_axi_wvalid) {
            beats_.emplace_back();
            std::memcpy(beats_.back().data, &top_.m_axi_wdata, kBytes);
            std::memcpy(beats_.back().strobes, &top_.m_axi_wstrb, (kBytes + 7) / 8);
        }
        while (!writes_.empty() && !beats_.empty()) write();
        if (top_.m_axi_bvalid && top_.m_axi_bready) answers_.pop_front();
        if (top_.m_axi_rvalid && top_.m_axi_rready) {
            reads_.front().address += kBytes;
            if (--reads_.front().beats == 0) reads_.pop_front();
        }
    }

private:
    static constexpr unsigned kBytes = sizeof(VColonnadeAxi::m_axi_rdata);

    struct Burst {
        std::uint64_t address, due;
        unsigned beats;
    };

    struct Beat {
        std::uint8_t data[kBytes], strobes[(kBytes + 7) / 8];
    };

    template <class T> static std::uint8_t* data(T& signal) { return reinterpret_cast<std::uint8_t*>(&signal); }

    std::uint8_t* at(std::uint64_t address) {
        const bool isImage = address < kFramebuffer;
        Bytes& bytes = isImage ? image : framebuffer;
        const std::uint64_t offset = address - (isImage ? kImage : kFramebuffer);
        if (offset >= bytes.size()) fail("an access beyond the memory, at " + std::to_string(address));
        return &bytes[offset];
    }

    void write() {
        Burst& burst = writes_.front();
        for (unsigned i = 0; i < kBytes; ++i)
            if (beats_.front().strobes[i / 8] >> i % 8 & 1) *at(burst.address + i) = beats_.front().data[i];
        beats_.pop_front();
        burst.address += kBytes;
        if (--burst.beats != 0) return;
        writes_.pop_front();
        answers_.push_back(now_ + kLatency);
    }

    VColonnadeAxi& top_;
    std::deque<Burst> writes_, reads_;
    std::deque<Beat> beats_;
    std::deque<std::uint64_t> answers_; // the cycles in which they are due
    std::uint64_t now_ = 0;
};

/// The clock, and accesses to s_axil.
class Bus {
public:
    explicit Bus(VColonnadeAxi& top, Memory& memory) : top_(top), memory_(memory) {
        top_.reset = 1;
        for (int i = 0; i < 10; ++i) cycle();
        top_.reset = 0;
        cycle();
    }

    std::uint64_t cycles() const { return cycles_; }

    std::uint32_t read(std::uint32_t address) {
        top_.s_axil_araddr = static_cast<std::uint16_t>(address);
        top_.s_axil_arvalid = top_.s_axil_rready = 1;
        while (!top_.s_axil_rvalid) {
            const bool isTaken = top_.s_axil_arready;
            cycle();
            if (isTaken) top_.s_axil_arvalid = 0;
        }
        const std::uint32_t value = top_.s_axil_rdata;
        if (top_.s_axil_rresp != 0) fail("the shell refuses a read of " + std::to_string(address));
        cycle();
        top_.s_axil_rready = 0;
        return value;
    }

    void write(std::uint32_t address, std::uint32_t value) {
        top_.s_axil_awaddr = static_cast<std::uint16_t>(address);
        top_.s_axil_wdata = value;
        top_.s_axil_wstrb = 15;
        top_.s_axil_awvalid = top_.s_axil_wvalid = top_.s_axil_bready = 1;
        while (!top_.s_axil_bvalid) {
            const bool isAddressTaken = top_.s_axil_awready, isDataTaken = top_.s_axil_wready;
            cycle();
            if (isAddressTaken) top_.s_axil_awvalid = 0;
            if (isDataTaken) top_.s_axil_wvalid = 0;
        }
        if (top_.s_axil_bresp != 0) fail("the shell refuses a write to " + std::to_string(address));
        cycle();
        top_.s_axil_bready = 0;
    }

    /// Until the interrupt, which the driver has enabled.
    void wait() {
        while (!top_.irq) cycle();
    }

private:
    void cycle() {
        if (++cycles_ > kMostCycles) fail("no interrupt");
        memory_.offer();
        memory_.take();
        top_.clock = 1;
        top_.eval();
        top_.clock = 0;
        top_.eval();
    }

    VColonnadeAxi& top_;
    Memory& memory_;
    std::uint64_t cycles_ = 0;
};

void check(const char* what, colonnade_error error) {
    if (error != COLONNADE_OK) fail(std::string(what) + ": " + colonnade_error_name(error));
}

} // namespace

int main(int argc, char** argv) {
    if (argc < 4) fail("usage: bench IMAGE FRAME OUTPUT [+backdoor=FOLDER]");
    VerilatedContext context;
    context.commandArgs(argc, argv);
    VColonnadeAxi top(&context);
    Memory memory(top);
    Bus bus(top, memory);
    const colonnade_bus accesses = {
        [](void* to, std::uint32_t address) { return static_cast<Bus*>(to)->read(address); },
        [](void* to, std::uint32_t address, std::uint32_t value) { static_cast<Bus*>(to)->write(address, value); },
        [](void* to) { static_cast<Bus*>(to)->wait(); },
        &bus,
    };
    colonnade device;
    check("probe", colonnade_probe(&device, &accesses, &colonnade_design));

    memory.image = readFile(argv[1]);
    if (*context.commandArgsPlusMatch("backdoor=") == 0) {
        const std::uint64_t begin = bus.cycles();
        const auto bytes = static_cast<std::uint32_t>(memory.image.size());
        const colonnade_image image = {memory.image.data(), bytes, kImage, {kImage, kImage + bytes}};
        check("load", colonnade_load(&device, &image, kAttempts));
        std::printf("load: %llu cycles\n", static_cast<unsigned long long>(bus.cycles() - begin));
    }

    const Bytes file = readFile(argv[2]);
    colonnade_frame frame;
    check("frame file", colonnade_open_frame(&colonnade_design, file.data(), file.size(), &frame));
    check("set frame", colonnade_set_frame(&device, &frame));
    const std::uint32_t tile = colonnade_design.tile_size, stride = (frame.width + tile - 1) / tile * tile * 4;
    memory.framebuffer.resize(std::size_t{stride} * frame.height);
    const colonnade_framebuffer framebuffer = {
        kFramebuffer, stride, COLONNADE_XRGB8888, {kFramebuffer, kFramebuffer + memory.framebuffer.size()}};
    const std::uint64_t begin = bus.cycles();
    check("start", colonnade_start(&device, &framebuffer));
    check("wait", colonnade_wait(&device, COLONNADE_FRAME_DONE, kAttempts));
    check("frame", colonnade_result(&device));
    std::printf("frame: %llu cycles\n", static_cast<unsigned long long>(bus.cycles() - begin));
    std::ofstream output(argv[3], std::ios::binary);
    for (std::uint32_t line = 0; line < frame.height; ++line)
        output.write(reinterpret_cast<const char*>(&memory.framebuffer[std::size_t{line} * stride]), 4 * frame.width);
    if (!output.flush()) fail(std::string("cannot write ") + argv[3]);
    top.final();
    return 0;
}
