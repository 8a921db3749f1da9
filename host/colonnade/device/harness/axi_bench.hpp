// ColonnadeAxi between a host at its registers and slaves at its masters, with all pins watched in every cycle.
#pragma once
#include <cstring>
#include <deque>
#include <stdexcept>

#include "VColonnadeAxi.h"
#include "axi_slave.hpp"
#include "ports.hpp"

/// Something that has to end does not.
struct Hang : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// An access to a register, and its answer. Delays are cycles in which a channel does not move.
struct Access {
    unsigned address = 0, strobes = 15;
    std::uint32_t data = 0;
    unsigned addressDelay = 0, dataDelay = 0, answerDelay = 0;
    unsigned response = 0;
};

/// The writes, or the reads, that a host has under way. The next ones are offered before the first is answered.
class Requests {
public:
    explicit Requests(bool hasData) : hasData_(hasData) {}

    void begin(const Access& access) { open_.push_back(access); }
    bool areDone() const { return open_.empty(); }
    bool offersAddress() { return addresses_ < open_.size() && passes(open_[addresses_].addressDelay); }
    bool offersData() { return hasData_ && data_ < open_.size() && passes(open_[data_].dataDelay); }
    const Access& address() const { return addresses_ < open_.size() ? open_[addresses_] : noise_; }
    const Access& data() const { return data_ < open_.size() ? open_[data_] : noise_; }
    bool mayBeAnswered() const { return addresses_ > 0 && (data_ > 0 || !hasData_); }
    bool takesAnswer() { return !mayBeAnswered() || passes(open_.front().answerDelay); }
    void takeAddress() { ++addresses_; }
    void takeData() { ++data_; }
    void answer(unsigned response, std::uint32_t data) {
        last = open_.front();
        last.response = response;
        last.data = data;
        answers.push_back(response);
        open_.pop_front();
        --addresses_;
        if (hasData_) --data_;
    }
    void reset() {
        open_.clear();
        addresses_ = data_ = 0;
    }

    Access last;
    std::vector<unsigned> answers;

private:
    static bool passes(unsigned& delay) {
        if (delay == 0) return true;
        --delay;
        return false;
    }

    const Access noise_{0x5A5A, 10, 0xDEADBEEF};
    bool hasData_;
    std::deque<Access> open_;
    std::size_t addresses_ = 0, data_ = 0; // how many were taken
};

class Bench {
public:
    Bench(Slaves& shared, unsigned busBytes) : slaves(shared), bus_(busBytes) { hardReset(10); }
    ~Bench() { top_.final(); }

    void cycles(std::uint64_t count) {
        while (count-- != 0) cycle();
    }

    void hardReset(unsigned count) {
        top_.reset = 1;
        write_.reset();
        read_.reset();
        cycles(count);
        top_.reset = 0;
        resets_ = 0;
    }

    unsigned write(unsigned address, std::uint32_t data, unsigned strobes = 15) {
        beginWrite(address, data, strobes);
        finish();
        return write_.last.response;
    }

    Access read(unsigned address) {
        beginRead(address);
        finish();
        return read_.last;
    }

    void beginWrite(unsigned address, std::uint32_t data, unsigned strobes = 15) {
        write_.begin({address, strobes, data, delay(), delay(), delay(), 0});
    }
    void beginRead(unsigned address) { read_.begin({address, 15, 0, delay(), 0, delay(), 0}); }

    /// Waits for the answers of what has begun; the answers of the writes, in order.
    std::vector<unsigned> finish() {
        ++slaves.accesses;
        for (unsigned i = 0; !write_.areDone() || !read_.areDone(); ++i) {
            if (i == patience_) throw Hang("an access to a register has no answer");
            cycle();
        }
        return std::exchange(write_.answers, {});
    }

    /// No burst is under way at a slave.
    bool isQuiet() const { return writes_.isIdle() && reads_.isIdle() && sceneIsQuiet(); }
    bool interrupt() const { return top_.irq; }

    Slaves& slaves;

private:
    static constexpr unsigned patience_ = 100000; // cycles to the answers of registers

    /// Seldom, and then often long.
    unsigned delay() { return slaves.below(8) != 0 ? 0 : slaves.below(slaves.below(4) == 0 ? 150 : 8); }

    void cycle() {
        ++slaves.report.cycle;
        offer();
        top_.clock = 0;
        top_.eval();
        decide();
        if (top_.reset) resetAll();
        else sample();
        top_.clock = 1;
        top_.eval();
    }

    /// Drives what does not depend on this cycle's outputs. Payloads that are not offered are noise.
    void offer() {
        writes_.offer();
        top_.m_axi_bvalid = writes_.offersAnswer;
        top_.m_axi_bresp = writes_.response();
        top_.m_axi_bid = writes_.id();
        reads_.offer();
        top_.m_axi_rvalid = reads_.offersBeat;
        top_.m_axi_rid = reads_.offersBeat ? reads_.id : slaves.below(2);
        top_.m_axi_rlast = reads_.offersBeat ? reads_.isLast : slaves.below(2);
        top_.m_axi_rresp = reads_.offersBeat ? reads_.response : slaves.below(4);
        std::memcpy(&top_.m_axi_rdata, reads_.data.data(), bus_);
        offerScene();

        top_.s_axil_awvalid = write_.offersAddress();
        top_.s_axil_wvalid = write_.offersData();
        top_.s_axil_arvalid = read_.offersAddress();
        top_.s_axil_awaddr = write_.address().address;
        top_.s_axil_wdata = write_.data().data;
        top_.s_axil_wstrb = write_.data().strobes;
        top_.s_axil_araddr = read_.address().address;
        top_.s_axil_awprot = slaves.below(8);
        top_.s_axil_arprot = slaves.below(8);
    }

    /// Drives the READYs of the slaves, which may depend on the VALIDs of this cycle; those do not depend on them.
    void decide() {
        const auto before = valids();
        writes_.decide(top_.m_axi_awvalid, top_.m_axi_wvalid);
        reads_.decide();
        top_.m_axi_awready = writes_.addressReady;
        top_.m_axi_wready = writes_.dataReady;
        top_.m_axi_arready = reads_.addressReady;
        decideScene();
        top_.s_axil_bready = write_.takesAnswer() && slaves.below(100) >= slaves.behaviour.stall / 2;
        top_.s_axil_rready = read_.takesAnswer() && slaves.below(100) >= slaves.behaviour.stall / 2;
        top_.eval();
        slaves.report.require(before == valids(), "ports", "a VALID depends on a READY in the same cycle");
    }

    std::array<bool, 6> valids() const {
        return {top_.m_axi_awvalid != 0, top_.m_axi_wvalid != 0,  top_.m_axi_arvalid != 0,
                sceneIsOffered(),        top_.s_axil_bvalid != 0, top_.s_axil_rvalid != 0};
    }

    void sample() {
        Report& report = slaves.report;
        if (resets_ == 0) requireSilence("the first cycle after reset");
        resets_ = 1;
        const Address aw{top_.m_axi_awaddr,  top_.m_axi_awlen, top_.m_axi_awsize,
                         top_.m_axi_awburst, top_.m_axi_awid,  top_.m_axi_awprot};
        const Address ar{top_.m_axi_araddr,  top_.m_axi_arlen, top_.m_axi_arsize,
                         top_.m_axi_arburst, top_.m_axi_arid,  top_.m_axi_arprot};
        WriteBeat beat;
        if (top_.m_axi_wvalid) {
            std::memcpy(beat.data.data(), &top_.m_axi_wdata, bus_);
            std::memcpy(beat.strobes.data(), &top_.m_axi_wstrb, (bus_ + 7) / 8);
            beat.isLast = top_.m_axi_wlast;
        }
        const bool answerIsTaken = writes_.offersAnswer && top_.m_axi_bready;
        const bool readIsTaken = reads_.offersBeat && top_.m_axi_rready;
        if (aw_.transfers(top_.m_axi_awvalid, top_.m_axi_awready, aw)) writes_.takeAddress(aw);
        if (w_.transfers(top_.m_axi_wvalid, top_.m_axi_wready, beat)) writes_.takeBeat(beat);
        if (ar_.transfers(top_.m_axi_arvalid, top_.m_axi_arready, ar)) reads_.takeAddress(ar);
        if (answerIsTaken) writes_.takeAnswer();
        if (readIsTaken) reads_.takeBeat();
        sampleScene();

        // The registers
        report.require(!top_.s_axil_bvalid || write_.mayBeAnswered(), "s_axil B", "an answer comes before its request");
        report.require(!top_.s_axil_rvalid || read_.mayBeAnswered(), "s_axil R", "an answer comes before its request");
        report.require(!top_.s_axil_bvalid || top_.s_axil_bresp == 0 || top_.s_axil_bresp == 2, "s_axil B",
                       "an answer is neither OKAY nor SLVERR");
        report.require(!top_.s_axil_rvalid || top_.s_axil_rresp == 0 || top_.s_axil_rresp == 2, "s_axil R",
                       "an answer is neither OKAY nor SLVERR");
        if (b_.transfers(top_.s_axil_bvalid, top_.s_axil_bready, top_.s_axil_bresp) && write_.mayBeAnswered())
            write_.answer(top_.s_axil_bresp, 0);
        const std::uint64_t answer = std::uint64_t{top_.s_axil_rresp} << 32 | top_.s_axil_rdata;
        if (r_.transfers(top_.s_axil_rvalid, top_.s_axil_rready, answer) && read_.mayBeAnswered())
            read_.answer(top_.s_axil_rresp, top_.s_axil_rdata);
        if (top_.s_axil_awvalid && top_.s_axil_awready) write_.takeAddress();
        if (top_.s_axil_wvalid && top_.s_axil_wready) write_.takeData();
        if (top_.s_axil_arvalid && top_.s_axil_arready) read_.takeAddress();
    }

    /// In a reset nothing is under way, and no VALID is high once it has been clocked in (A3.1.2).
    void resetAll() {
        if (resets_++ > 1) requireSilence("a reset");
        resets_ = resets_ < 2 ? 2 : resets_;
        aw_.reset();
        w_.reset();
        ar_.reset();
        b_.reset();
        r_.reset();
        writes_.reset();
        reads_.reset();
        resetScene();
    }

    void requireSilence(const char* when) {
        if (top_.m_axi_awvalid || top_.m_axi_wvalid || top_.m_axi_arvalid || top_.s_axil_bvalid || top_.s_axil_rvalid ||
            sceneIsOffered())
            slaves.report.broken(std::string("a VALID is high in ") + when);
    }

#ifdef DRAM_BUS_BYTES
    bool sceneIsQuiet() const { return scene_.isIdle(); }
    bool sceneIsOffered() const { return top_.m_axi_scene_arvalid; }
    void resetScene() {
        scene_.reset();
        sceneAr_.reset();
    }
    void offerScene() {
        scene_.offer();
        top_.m_axi_scene_rvalid = scene_.offersBeat;
        top_.m_axi_scene_rid = scene_.offersBeat ? scene_.id : slaves.below(2);
        top_.m_axi_scene_rlast = scene_.offersBeat ? scene_.isLast : slaves.below(2);
        top_.m_axi_scene_rresp = scene_.offersBeat ? scene_.response : slaves.below(4);
        std::memcpy(&top_.m_axi_scene_rdata, scene_.data.data(), DRAM_BUS_BYTES);
    }
    void decideScene() {
        scene_.decide();
        top_.m_axi_scene_arready = scene_.addressReady;
    }
    void sampleScene() {
        const Address ar{top_.m_axi_scene_araddr,  top_.m_axi_scene_arlen, top_.m_axi_scene_arsize,
                         top_.m_axi_scene_arburst, top_.m_axi_scene_arid,  top_.m_axi_scene_arprot};
        const bool isTaken = scene_.offersBeat && top_.m_axi_scene_rready;
        if (sceneAr_.transfers(top_.m_axi_scene_arvalid, top_.m_axi_scene_arready, ar)) scene_.takeAddress(ar);
        if (isTaken) scene_.takeBeat();
    }
    ReadSlave scene_{slaves, "m_axi_scene AR", DRAM_BUS_BYTES, Silent::sceneAr, Silent::sceneR};
    Channel<Address> sceneAr_{slaves.report, "m_axi_scene AR"};
#else
    bool sceneIsQuiet() const { return true; }
    bool sceneIsOffered() const { return false; }
    void resetScene() {}
    void offerScene() {}
    void decideScene() {}
    void sampleScene() {}
#endif

    VColonnadeAxi top_;
    unsigned bus_, resets_ = 0;
    WriteSlave writes_{slaves, bus_};
    ReadSlave reads_{slaves, "m_axi AR", bus_, Silent::ar, Silent::r};
    Channel<Address> aw_{slaves.report, "m_axi AW"}, ar_{slaves.report, "m_axi AR"};
    Channel<WriteBeat> w_{slaves.report, "m_axi W"};
    Channel<unsigned> b_{slaves.report, "s_axil B"};
    Channel<std::uint64_t> r_{slaves.report, "s_axil R"};
    Requests write_{true}, read_{false};
};
