// The memory of the shell's testbench (shell.cpp).
#pragma once
#include <cstdint>
#include <cstring>
#include <deque>
#include <map>
#include <random>
#include <stdexcept>
#include <string>

#include "VColonnadeAxi.h"
#include "ports.hpp"

#include "bus_bytes.hpp"
#include "dram.hpp"

#ifdef DRAM_BUS_BYTES
/// The pins of m_axi_scene, under the names that the core's read port has.
struct ScenePins {
    explicit ScenePins(VColonnadeAxi& top)
        : io_memory_ar_valid(top.m_axi_scene_arvalid), io_memory_ar_ready(top.m_axi_scene_arready),
          io_memory_ar_bits_addr(top.m_axi_scene_araddr), io_memory_ar_bits_len(top.m_axi_scene_arlen),
          io_memory_ar_bits_size(top.m_axi_scene_arsize), io_memory_ar_bits_id(top.m_axi_scene_arid),
          io_memory_r_valid(top.m_axi_scene_rvalid), io_memory_r_ready(top.m_axi_scene_rready),
          io_memory_r_bits_data(top.m_axi_scene_rdata), io_memory_r_bits_id(top.m_axi_scene_rid),
          io_memory_r_bits_last(top.m_axi_scene_rlast), io_memory_r_bits_resp(top.m_axi_scene_rresp) {}

    CData &io_memory_ar_valid, &io_memory_ar_ready;
    QData& io_memory_ar_bits_addr;
    CData &io_memory_ar_bits_len, &io_memory_ar_bits_size, &io_memory_ar_bits_id, &io_memory_r_valid,
        &io_memory_r_ready;
    decltype(VColonnadeAxi::m_axi_scene_rdata) io_memory_r_bits_data; // a reference, whose type depends on the width
    CData &io_memory_r_bits_id, &io_memory_r_bits_last, &io_memory_r_bits_resp;
};

/// Reads of the scene: reads of different ids overtake each other where channels stall.
class Scene {
public:
    Scene(VColonnadeAxi& top, const DramOptions& options, BusBytes& bytes) : pins_(top), dram_(pins_, options, bytes) {}
    void offer() { dram_.offer(); }
    void take() { dram_.take(); }
    void fail(unsigned errorsPer1024) { dram_.fail(errorsPer1024); }

private:
    ScenePins pins_;
    Dram<ScenePins, BusBytes> dram_;
};
#else
/// A design without a scene in DRAM.
struct Scene {
    Scene(VColonnadeAxi&, const DramOptions&, BusBytes&) {}
    void offer() {}
    void take() {}
    void fail(unsigned) { throw std::runtime_error("this design reads no scene"); }
};
#endif

/// When a memory takes the address and the data of a write; AXI4 allows all of these.
enum class WriteOrder : unsigned {
    any,
    addressAfterDataValid,
    dataAfterAddress,
    together,
    addressAfterLastBeat,
    count
};

/// How the memory behind a master behaves.
struct MasterTiming {
    unsigned latency = 1, stall = 0, order = 0, errorsPer1024 = 0, seed = 1;
};

// clang-format off
#define EACH_MASTER_PIN(DO, prefix) \
    DO(prefix, awvalid) DO(prefix, awready) DO(prefix, awaddr) DO(prefix, awlen) DO(prefix, awid) \
    DO(prefix, wvalid) DO(prefix, wready) DO(prefix, wdata) DO(prefix, wstrb) DO(prefix, wlast) \
    DO(prefix, bvalid) DO(prefix, bready) DO(prefix, bid) DO(prefix, bresp) \
    DO(prefix, arvalid) DO(prefix, arready) DO(prefix, araddr) DO(prefix, arlen) DO(prefix, arid) \
    DO(prefix, rvalid) DO(prefix, rready) DO(prefix, rdata) DO(prefix, rid) DO(prefix, rlast) DO(prefix, rresp)
// clang-format on
#define PIN(prefix, pin) decltype(VColonnadeAxi::prefix##_##pin) pin; // a reference, whose type depends on the width
#define CONNECTED(prefix, pin) , pin(top.prefix##_##pin)
/// A struct with the pins of an AXI4 master that reads and writes.
#define MASTER(Name, prefix) \
    struct Name { \
        explicit Name(VColonnadeAxi& top) : model(top) EACH_MASTER_PIN(CONNECTED, prefix) {} \
        VColonnadeAxi& model; \
        EACH_MASTER_PIN(PIN, prefix) \
    };

MASTER(MasterPins, m_axi)
#ifdef HAS_REFIT
MASTER(RefitPins, m_axi_refit)
#endif

/// The memory behind a master, whose answers come in order.
template <class Pins> class MemoryPort {
public:
    MemoryPort(VColonnadeAxi& top, unsigned busBytes, const MasterTiming& timing, BusBytes& bytes)
        : pins_(top), bus_(busBytes), bytes_(bytes) {
        set(timing);
        pins_.bvalid = pins_.rvalid = pins_.bresp = pins_.rresp = pins_.bid = pins_.rid = 0;
    }

    /// From now on.
    void set(const MasterTiming& timing) {
        timing_ = timing;
        order_ = static_cast<WriteOrder>(timing.order % static_cast<unsigned>(WriteOrder::count));
        random_.seed(timing.seed);
    }

    /// Sets the inputs for this cycle. What is offered stays.
    void offer() {
        ++now_;
        offerWrites();
        pins_.arready = moves();
        if (!pins_.bvalid && !answers_.empty() && answers_.front().due <= now_ && moves()) {
            pins_.bvalid = 1;
            pins_.bresp = response();
            pins_.bid = static_cast<CData>(answers_.front().id);
        }
        if (!pins_.rvalid && !reads_.empty() && reads_.front().due <= now_ && moves()) offerBeat(reads_.front());
    }

    /// Takes the transfers of this cycle; afterwards `offer` may change what was taken.
    void take() {
        checkOrder();
        if (pins_.awvalid && pins_.awready) writes_.push_back(burst(pins_.awaddr, pins_.awlen, pins_.awid));
        if (pins_.arvalid && pins_.arready) reads_.push_back(burst(pins_.araddr, pins_.arlen, pins_.arid));
        if (pins_.wvalid && pins_.wready) takeBeat();
        while (!writes_.empty() && !beats_.empty()) write();
        if (pins_.bvalid && pins_.bready) {
            answers_.pop_front();
            takenB_ = true;
        }
        if (pins_.rvalid && pins_.rready) {
            if (++reads_.front().done == reads_.front().beats) reads_.pop_front();
            takenR_ = true;
        }
    }

    /// After the clock edge: withdraws what was taken.
    void finish() {
        if (takenB_) pins_.bvalid = 0;
        if (takenR_) pins_.rvalid = 0;
        takenB_ = takenR_ = false;
    }

private:
    struct Burst {
        std::uint64_t address, due;
        unsigned beats, done, id;
    };

    struct Beat {
        std::uint8_t data[128] = {}, strobes[16] = {};
        bool isLast = false;
    };

    bool moves() { return timing_.stall == 0 || random_() % 100 >= timing_.stall; }

    /// SLVERR or DECERR for some answers.
    CData response() {
        return timing_.errorsPer1024 != 0 && random_() % 1024 < timing_.errorsPer1024 ? 2 + random_() % 2 : 0;
    }

    /// Offers the next beat of a read, whose data are other ones if it fails.
    void offerBeat(const Burst& read) {
        std::uint8_t data[128];
        std::memcpy(data, bytes_.range(read.address + read.done * bus_, bus_), bus_);
        pins_.rvalid = 1;
        pins_.rresp = response();
        for (unsigned i = 0; i < bus_ && pins_.rresp != 0; ++i) data[i] = ~data[i];
        std::memcpy(&pins_.rdata, data, bus_);
        pins_.rid = static_cast<CData>(read.id);
        pins_.rlast = read.done + 1 == read.beats;
    }

    Burst burst(std::uint64_t address, unsigned length, unsigned id) {
        const std::uint64_t first = address / bus_ * bus_, end = first + (length + 1ull) * bus_;
        if (first / 4096 != (end - 1) / 4096) throw std::runtime_error("a burst crosses a page of 4 KB");
        bytes_.range(first, end - first);
        return {first, now_ + timing_.latency, length + 1, 0, id};
    }

    void offerWrites() {
        const bool hasAddress = pins_.awvalid, hasData = pins_.wvalid;
        bool takesAddress = moves(), takesData = moves();
        switch (order_) {
        case WriteOrder::addressAfterDataValid: takesAddress &= hasData || !beats_.empty(); break;
        case WriteOrder::dataAfterAddress: takesData &= !writes_.empty(); break;
        case WriteOrder::together:
            takesData = takesAddress && (hasAddress || !writes_.empty());
            takesAddress &= hasData;
            break;
        case WriteOrder::addressAfterLastBeat: takesAddress &= wholeBursts_ > 0; break;
        default: break;
        }
        pins_.awready = takesAddress;
        pins_.wready = takesData;
    }

    /// No data are offered before their address is.
    void checkOrder() {
        if (pins_.awvalid && !isAnnounced_) ++announced_;
        isAnnounced_ = pins_.awvalid && !pins_.awready;
        if (!pins_.wvalid) return;
        if (isFirstBeat_) ++begun_;
        isFirstBeat_ = pins_.wready && pins_.wlast;
        if (begun_ > announced_) throw std::runtime_error("data are offered before their address");
    }

    void takeBeat() {
        Beat beat;
        std::memcpy(beat.data, &pins_.wdata, bus_);
        std::memcpy(beat.strobes, &pins_.wstrb, (bus_ + 7) / 8);
        beat.isLast = pins_.wlast;
        wholeBursts_ += beat.isLast;
        beats_.push_back(beat);
    }

    void write() {
        Burst& burst = writes_.front();
        const Beat beat = beats_.front();
        beats_.pop_front();
        wholeBursts_ -= beat.isLast;
        std::uint8_t* to = bytes_.range(burst.address + burst.done * bus_, bus_);
        for (unsigned i = 0; i < bus_; ++i)
            if (beat.strobes[i / 8] >> i % 8 & 1) to[i] = beat.data[i];
        ++burst.done;
        if (beat.isLast != (burst.done == burst.beats))
            throw std::runtime_error("a burst does not end with its last beat");
        if (burst.done < burst.beats) return;
        answers_.push_back(burst);
        answers_.back().due = now_ + timing_.latency;
        writes_.pop_front();
    }

    Pins pins_;
    unsigned bus_;
    MasterTiming timing_;
    WriteOrder order_ = WriteOrder::any;
    std::mt19937 random_;
    BusBytes& bytes_;
    std::deque<Burst> writes_, reads_, answers_;
    std::deque<Beat> beats_;        // without their address
    unsigned wholeBursts_ = 0;      // of them
    std::uint64_t now_ = 0, announced_ = 0, begun_ = 0; // addresses that were offered, bursts whose data were
    bool isAnnounced_ = false, isFirstBeat_ = true, takenB_ = false, takenR_ = false;
};

/// The memory behind all masters.
class Memory {
public:
    Memory(VColonnadeAxi& top, std::map<std::string, unsigned>& options, const std::string& shared)
        : Memory(top, options, {options["--latency"], options["--stall"], options["--order"], 0, options["--seed"]},
                 shared) {}

    std::uint8_t* range(std::uint64_t address, std::uint64_t size) { return bytes_.range(address, size); }

    /// Sets the inputs for this cycle. What is offered stays.
    void offer() {
        master_.offer();
        refit_.offer();
        scene_.offer();
        top_.eval();
    }

    /// Takes the transfers of this cycle; afterwards `offer` may change what was taken.
    void take() {
        master_.take();
        refit_.take();
        scene_.take();
    }

    /// The memory behind the masters, not the scene's, from now on.
    void set(const MasterTiming& timing) {
        master_.set(timing);
        refit_.set(timing);
    }

    /// So many of 1024 beats of the scene's reads fail from now on.
    void failScene(unsigned errorsPer1024) { scene_.fail(errorsPer1024); }

    /// After the clock edge: withdraws what was taken.
    void finish() {
        master_.finish();
        refit_.finish();
    }

private:
    Memory(VColonnadeAxi& top, std::map<std::string, unsigned>& options, const MasterTiming& timing,
           const std::string& shared)
        : top_(top), bytes_(options["--base"], options["--memory"], shared),
          master_(top, options["--bus"], timing, bytes_), refit_(top, options["--bus"], timing, bytes_),
          scene_(top, {timing.latency, timing.stall, 0, 0, timing.seed}, bytes_) {}

    VColonnadeAxi& top_;
    BusBytes bytes_;
    MemoryPort<MasterPins> master_;
#ifdef HAS_REFIT
    MemoryPort<RefitPins> refit_;
#else
    /// A shell without the unit.
    struct Nothing {
        Nothing(VColonnadeAxi&, unsigned, const MasterTiming&, BusBytes&) {}
        void set(const MasterTiming&) {}
        void offer() {}
        void take() {}
        void finish() {}
    } refit_;
#endif
    Scene scene_;
};
