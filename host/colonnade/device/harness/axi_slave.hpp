// Slaves of AXI4 that make any legal use of the protocol: orders, stalls, latencies, errors, silence.
#pragma once
#include <deque>
#include <random>
#include <set>

#include "axi_rules.hpp"

/// When a slave takes the address and the data of a write. AXI4 (A3.3.1) allows all of these.
enum class Order {
    any,                ///< each channel by itself
    dataValidFirst,     ///< AWREADY waits for WVALID
    firstBeatFirst,     ///< the address is taken after the first beat
    wholeBurstFirst,    ///< the address is taken after the last beat
    addressValidFirst,  ///< WREADY waits for AWVALID
    addressFirst,       ///< data are taken after the address
    together,           ///< the address and the first beat in the same cycle
    lateAddress,        ///< the address is taken up to 200 cycles after it was offered
    lateData,           ///< data are taken up to 200 cycles after their address
    mixed               ///< each burst in another order
};
constexpr unsigned orders = 10;
constexpr const char* orderNames[orders] = {
    "any",          "dataValidFirst", "firstBeatFirst", "wholeBurstFirst", "addressValidFirst",
    "addressFirst", "together",       "lateAddress",    "lateData",        "mixed"};

enum class Silent { none, aw, w, b, ar, r, sceneAr, sceneR };
constexpr unsigned silentChannels = 7;

/// What the slaves do.
struct Behaviour {
    Order order = Order::any;
    unsigned stall = 10;   ///< percentage of cycles in which a channel does not move
    unsigned latency = 10; ///< cycles to an answer, at most
    unsigned errorsPer1000 = 0;
    Silent silent = Silent::none; ///< a channel that does not move before the cycle `silentUntil`
    std::uint64_t silentUntil = 0;
};

/// What all slaves share.
struct Slaves {
    Report report;
    Behaviour behaviour;
    std::mt19937_64 random;
    std::vector<std::uint8_t> memory;
    Windows readable, writable;
    std::uint64_t bursts = 0, accesses = 0, writtenBeats = 0; // beats that write a byte

    std::uint64_t below(std::uint64_t end) { return random() % end; }
    bool moves(Silent channel) {
        if (channel == behaviour.silent && report.cycle < behaviour.silentUntil) return false;
        return below(100) >= behaviour.stall;
    }
    std::uint64_t due() { return report.cycle + 1 + below(behaviour.latency + 1); }
    unsigned responseUpTo(std::uint64_t end) {
        if (end > memory.size()) return 3;
        return below(1000) < behaviour.errorsPer1000 ? 2 + below(2) : 0;
    }
};

/// The write channels of a slave.
class WriteSlave {
public:
    WriteSlave(Slaves& slaves, unsigned busBytes) : slaves_(slaves), bus_(busBytes) {}

    /// Chooses the answer that is offered in this cycle.
    void offer() {
        if (!offersAnswer && !answers_.empty() && answers_.front().due <= slaves_.report.cycle &&
            slaves_.moves(Silent::b))
            offersAnswer = true;
    }
    unsigned response() { return offersAnswer ? answers_.front().response : slaves_.below(4); }
    unsigned id() { return offersAnswer ? answers_.front().id : slaves_.below(2); }

    /// Decides what is taken in this cycle, if it is offered.
    void decide(bool addressIsValid, bool dataAreValid) {
        const bool isBetween = addresses_.empty() && beats_.empty();
        if (isBetween && wasBusy_) order_ = static_cast<Order>(slaves_.below(orders - 1));
        wasBusy_ = !isBetween;
        addressWait_ = addressIsValid ? addressWait_ + 1 : 0;
        if (!addresses_.empty()) ++dataWait_;
        const Order order = slaves_.behaviour.order == Order::mixed ? order_ : slaves_.behaviour.order;
        addressReady = slaves_.moves(Silent::aw);
        dataReady = slaves_.moves(Silent::w);
        switch (order) {
        case Order::dataValidFirst: addressReady &= dataAreValid || !beats_.empty(); break;
        case Order::firstBeatFirst: addressReady &= !beats_.empty(); break;
        case Order::wholeBurstFirst: addressReady &= wholeBursts_ != 0; break;
        case Order::addressValidFirst: dataReady &= addressIsValid || !addresses_.empty(); break;
        case Order::addressFirst: dataReady &= !addresses_.empty(); break;
        case Order::together:
            if (isBetween) addressReady = dataReady = addressReady && dataReady && addressIsValid && dataAreValid;
            else addressReady = addressReady && !beats_.empty();
            break;
        case Order::lateAddress: addressReady &= addressWait_ > delay_; break;
        case Order::lateData: dataReady &= !addresses_.empty() && dataWait_ > delay_; break;
        default: break;
        }
    }

    void takeAddress(const Address& address) {
        requireLegal(slaves_.report, "m_axi AW", address, bus_);
        addresses_.push_back(address);
        ++slaves_.bursts;
        dataWait_ = 0;
        delay_ = slaves_.below(200);
        match();
    }

    void takeBeat(const WriteBeat& beat) {
        beats_.push_back(beat);
        wholeBursts_ += beat.isLast;
        slaves_.writtenBeats += beat.strobes != decltype(beat.strobes){};
        match();
    }

    void takeAnswer() {
        offersAnswer = false;
        answers_.pop_front();
    }

    bool isIdle() const { return addresses_.empty() && beats_.empty() && answers_.empty(); }

    void reset() {
        addresses_.clear();
        beats_.clear();
        answers_.clear();
        beat_ = wholeBursts_ = addressWait_ = dataWait_ = 0;
        offersAnswer = false;
    }

    bool addressReady = false, dataReady = false, offersAnswer = false;

private:
    struct Answer {
        std::uint64_t due;
        unsigned response, id;
    };

    /// Writes the beats whose address is known.
    void match() {
        for (; !addresses_.empty() && !beats_.empty(); beats_.pop_front()) {
            const Address& burst = addresses_.front();
            const WriteBeat& beat = beats_.front();
            const std::uint64_t first = burst.first() + std::uint64_t{beat_} * bus_;
            for (unsigned i = 0; i < bus_; ++i) {
                if (!beat.writes(i)) continue;
                slaves_.report.require(isInside(slaves_.writable, first + i, first + i + 1), "m_axi W",
                                       "a byte is written outside the window");
                if (first + i < slaves_.memory.size()) slaves_.memory[first + i] = beat.data[i];
            }
            const bool isLast = ++beat_ == burst.beats();
            slaves_.report.require(beat.isLast == isLast, "m_axi W", "WLAST is not with the last beat");
            wholeBursts_ -= beat.isLast;
            if (!isLast) continue;
            answers_.push_back({slaves_.due(), slaves_.responseUpTo(burst.end()), burst.id});
            addresses_.pop_front();
            beat_ = 0;
            dataWait_ = 0;
        }
    }

    Slaves& slaves_;
    unsigned bus_;
    std::deque<Address> addresses_; // whose data are not complete
    std::deque<WriteBeat> beats_;   // without their address
    std::deque<Answer> answers_;
    unsigned beat_ = 0, wholeBursts_ = 0;
    std::uint64_t addressWait_ = 0, dataWait_ = 0, delay_ = 0;
    Order order_ = Order::any;
    bool wasBusy_ = false;
};

/// The read channels of a slave. Reads of one id are answered in order, reads of others overtake and interleave.
class ReadSlave {
public:
    ReadSlave(Slaves& slaves, std::string port, unsigned busBytes, Silent address, Silent data)
        : slaves_(slaves), port_(std::move(port)), bus_(busBytes), addressChannel_(address), dataChannel_(data) {}

    /// Chooses the beat that is offered in this cycle.
    void offer() {
        if (offersBeat || reads_.empty() || !slaves_.moves(dataChannel_)) return;
        std::vector<std::size_t> due;
        std::set<unsigned> ids;
        for (std::size_t i = 0; i < reads_.size(); ++i)
            if (ids.insert(reads_[i].burst.id).second && reads_[i].due <= slaves_.report.cycle) due.push_back(i);
        if (due.empty()) return;
        chosen_ = due[slaves_.below(due.size())];
        const Read& read = reads_[chosen_];
        const std::uint64_t at = read.burst.first() + std::uint64_t{read.done} * bus_;
        id = read.burst.id;
        response = slaves_.responseUpTo(at + bus_);
        isLast = read.done + 1 == read.burst.beats();
        for (unsigned i = 0; i < bus_; ++i)
            data[i] = response == 0 ? slaves_.memory[at + i] : static_cast<std::uint8_t>(slaves_.random());
        offersBeat = true;
    }

    void decide() { addressReady = slaves_.moves(addressChannel_); }

    void takeAddress(const Address& address) {
        requireLegal(slaves_.report, port_, address, bus_);
        slaves_.report.require(isInside(slaves_.readable, address.first(), address.end()), port_,
                               "a read leaves its window");
        reads_.push_back({address, slaves_.due(), 0});
        ++slaves_.bursts;
    }

    void takeBeat() {
        offersBeat = false;
        if (++reads_[chosen_].done == reads_[chosen_].burst.beats())
            reads_.erase(reads_.begin() + static_cast<std::ptrdiff_t>(chosen_));
    }

    bool isIdle() const { return reads_.empty(); }

    void reset() {
        reads_.clear();
        offersBeat = false;
    }

    bool addressReady = false, offersBeat = false, isLast = false;
    unsigned id = 0, response = 0;
    std::array<std::uint8_t, 128> data{};

private:
    struct Read {
        Address burst;
        std::uint64_t due;
        unsigned done;
    };

    Slaves& slaves_;
    std::string port_;
    unsigned bus_;
    Silent addressChannel_, dataChannel_;
    std::deque<Read> reads_;
    std::size_t chosen_ = 0;
};
