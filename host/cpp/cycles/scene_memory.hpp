// memory/: column memories or caches, the cache that columns share, and DRAM.
#pragma once
#include <deque>
#include <vector>

#include "record_fetch.hpp"

namespace colonnade::cycles {

/// The lines that a bank of a cache holds: memory/TagStore.scala.
class TagStore {
public:
    TagStore(int sets, int ways)
        : sets_(static_cast<std::uint32_t>(sets)), ways_(ways), lines_(static_cast<std::size_t>(sets * ways), none),
          trees_(static_cast<std::size_t>(sets)) {}

    /// The way that holds a line, or -1.
    int find(std::uint32_t line) const {
        for (int way = 0; way < ways_; ++way)
            if (lines_[at(line, way)] == line) return way;
        return -1;
    }

    /// The way for a new line.
    int victim(std::uint32_t line) const {
        for (int way = 0; way < ways_; ++way)
            if (lines_[at(line, way)] == none) return way;
        const std::uint32_t tree = trees_[line & (sets_ - 1)];
        int first = 0, end = ways_;
        while (end - first > 1) {
            const int upper = (first + end) / 2;
            (tree >> (upper - 1) & 1 ? first : end) = upper;
        }
        return first;
    }

    void use(std::uint32_t line, int way) {
        std::uint32_t& tree = trees_[line & (sets_ - 1)];
        int first = 0, end = ways_;
        while (end - first > 1) {
            const int upper = (first + end) / 2;
            const std::uint32_t bit = 1u << (upper - 1);
            tree = way < upper ? tree | bit : tree & ~bit;
            (way < upper ? end : first) = upper;
        }
    }

    void replace(std::uint32_t line, int way) {
        lines_[at(line, way)] = line;
        use(line, way);
    }

private:
    static constexpr std::uint32_t none = ~std::uint32_t(0);

    std::size_t at(std::uint32_t line, int way) const {
        return (line & (sets_ - 1)) * static_cast<std::size_t>(ways_) + static_cast<std::size_t>(way);
    }

    std::uint32_t sets_;
    int ways_;
    std::vector<std::uint32_t> lines_, trees_;
};

/// A line that comes over a bus of the shared cache.
struct Announcement {
    std::uint32_t line;
    bool isValid = false;
};

/// One bank of a column: column/ColumnBvhController.scala with memory/ColumnCache.scala, or with a memory of the whole
/// scene.
class ColumnBank {
public:
    ColumnBank(const Design& design, int bank)
        : design_(design), bank_(bank), hasCache_(design.hasCache),
          tags_(hasCache_ ? std::max(1, design.cache.lines / design.banks / design.cache.ways) : 1,
                hasCache_ ? design.cache.ways : 1),
          awaited_(hasCache_ ? static_cast<std::size_t>(design.cache.misses / design.banks) : 0),
          maxInFlight_(hasCache_ ? 3u + design.extraSlices : static_cast<unsigned>(design.readLatency + 1)),
          readCycles_(hasCache_ ? 2 + design.extraSlices : design.readLatency),
          free_(static_cast<int>(awaited_.size())) {}

    /// The broadcast of this cycle.
    const Broadcast& broadcast() const { return broadcast_; }

    /// The record is being read, so that its row need not request it.
    bool isComing(std::uint32_t address) const {
        if (!design_.snooping) return false;
        for (std::size_t i = 0; i < inFlight_.count(); ++i)
            if (inFlight_.at(i).address == address) return true;
        return false;
    }

    bool isReady() const {
        return inFlight_.count() < maxInFlight_ &&
               (!hasCache_ || (blocked_ == 0 && free_ > static_cast<int>(accepted_)));
    }

    /// The rest of a cycle, after `requests` by row, of those that do not come, and the line that is announced. `row`:
    /// that is accepted, or -1; `address`: its record.
    void step(Cycle now, int row, std::uint32_t address, const Announcement& announced) {
        broadcast_.isValid = false;
        if (!inFlight_.isEmpty() && inFlight_.front().answers <= now) {
            const Read& read = inFlight_.front();
            broadcast_ = {read.address, read.row, true, read.isLater};
            inFlight_.pop();
        }
        if (!hasCache_) {
            if (row >= 0) inFlight_.push({address, row, now + readCycles_, false});
            return;
        }

        // Cycles a + 3 and a + 4: records of a line that has come
        if (!fills_.isEmpty() && now >= fills_.front().at) {
            const auto word = static_cast<std::uint32_t>(now - fills_.front().at);
            broadcast_ = {design_.recordOf(fills_.front().line, bank_) + word, -1, true, false};
            if (word + 1 == lineRecords) fills_.pop();
        }

        // Cycle c + 1: compare the request before
        int enters = -1;
        if (accepted_) {
            Read& read = inFlight_.at(inFlight_.count() - 1);
            const std::uint32_t line = design_.lineOf(read.address);
            if (const int way = tags_.find(line); way >= 0) tags_.use(line, way);
            else {
                read.isLater = true;
                ++misses;
                if (!isAwaited(line)) {
                    for (std::size_t i = 0; i < awaited_.size() && enters < 0; ++i)
                        if (!awaited_[i].isUsed) enters = static_cast<int>(i);
                    entering_ = line;
                }
            }
        }
        accepted_ = row >= 0;
        if (row >= 0) inFlight_.push({address, row, now + readCycles_, false});

        // Cycle a + 1: the line replaces another one
        if (taken_) {
            tags_.replace(line_, tags_.victim(line_));
            for (Awaited& entry : awaited_)
                if (entry.isUsed && entry.line == line_) {
                    entry.isUsed = false;
                    ++free_;
                }
            fills_.push({now + 2, line_});
        }

        // Cycle a: an announced line is taken if it is awaited
        if (blocked_ > 0) --blocked_;
        const bool isAnnounced = announced.isValid && isAwaited(announced.line);
        if (isAnnounced) {
            line_ = announced.line;
            blocked_ = 3;
        }
        taken_ = isAnnounced;
        if (enters >= 0) {
            awaited_[static_cast<std::size_t>(enters)] = {entering_, true, false};
            --free_;
        }
        choose();
    }

    /// The line that is requested from the shared cache, if any.
    bool requestsLine() const { return open_ >= 0; }
    std::uint32_t requestedLine() const { return awaited_[static_cast<std::size_t>(open_)].line; }
    void takeLineRequest() { awaited_[static_cast<std::size_t>(open_)].isRequested = true; }

    std::uint64_t misses = 0;

private:
    struct Read {
        std::uint32_t address;
        int row;
        Cycle answers;
        bool isLater;
    };
    struct Awaited {
        std::uint32_t line = 0;
        bool isUsed = false, isRequested = false;
    };

    bool isAwaited(std::uint32_t line) const {
        for (const Awaited& entry : awaited_)
            if (entry.isUsed && entry.line == line) return true;
        return false;
    }

    void choose() {
        open_ = -1;
        if (free_ == static_cast<int>(awaited_.size())) return;
        for (std::size_t i = 0; i < awaited_.size() && open_ < 0; ++i)
            if (awaited_[i].isUsed && !awaited_[i].isRequested) open_ = static_cast<int>(i);
    }

    const Design& design_;
    int bank_;
    bool hasCache_;
    TagStore tags_;
    std::vector<Awaited> awaited_;
    std::size_t maxInFlight_;
    Cycle readCycles_;
    Ring<Read, 32> inFlight_;
    Broadcast broadcast_{};
    bool accepted_ = false, taken_ = false;
    int blocked_ = 0, free_, open_ = -1;
    std::uint32_t line_ = 0, entering_ = 0;
    struct Fill {
        Cycle at;
        std::uint32_t line;
    };
    Ring<Fill, 4> fills_;
};

/// DRAM behind the device's read port, as the simulator's harness models it: a constant latency, and a beat every
/// `interval` cycles in the order of the reads.
class Dram {
public:
    Dram(const Design& design, const DramDesign& dram)
        : latency_(dram.latency), interval_(dram.interval),
          beats_(design.hasCache ? (lineRecords * static_cast<unsigned>(design.recordBytes) +
                                    static_cast<unsigned>(design.cache.busBytes) - 1) /
                                       static_cast<unsigned>(design.cache.busBytes)
                                 : 1) {}

    void read(Cycle now, int bank) { reads_.push_back({now + 1 + latency_, bank, 0}); }

    /// The bank whose beat is offered in this cycle, or -1.
    int offers(Cycle now) const {
        return !reads_.empty() && reads_.front().due <= now && next_ <= now ? reads_.front().bank : -1;
    }

    /// The beat is taken; returns whether it was the last one of its line.
    bool take(Cycle now) {
        next_ = now + interval_;
        if (++reads_.front().sent < beats_) return false;
        reads_.pop_front();
        return true;
    }

private:
    struct Read {
        Cycle due;
        int bank;
        unsigned sent;
    };

    Cycle latency_, interval_, next_ = 0;
    unsigned beats_;
    std::deque<Read> reads_;
};

/// A bank of the cache that all columns share: memory/SharedCache.scala, AwaitedLines.scala.
class SharedBank {
public:
    static constexpr int columnsPerBus = 4, maxBuses = 64;

    SharedBank(const Design& design, int bank)
        : design_(design), bank_(bank), buses_((design.columns + columnsPerBus - 1) / columnsPerBus),
          tags_(std::max(1, design.cache.sharedLines / design.banks / design.cache.sharedWays),
                design.cache.sharedWays),
          awaited_(static_cast<std::size_t>(design.cache.sharedMisses / design.banks)) {}

    /// What the bus of a column announces in this cycle.
    const Announcement& announced(int column) const {
        return announced_[static_cast<std::size_t>(column / columnsPerBus)];
    }

    /// The bank asks for a line of DRAM.
    bool reads() const { return awaited_[sender_].isUsed && !awaited_[sender_].isSent; }
    void takeRead() {
        awaited_[sender_].isSent = true;
        sender_ = after(sender_);
        ++dramReads;
    }

    /// Whether the port takes a beat of this bank, and that it does; `isLast`: of its line.
    bool takesBeat() const { return !isGathered_ || !hasLine_ || isFilling_; }
    void takeBeat(bool isLast) { gathers_ = isLast; }

    /// A cycle. `banks`: of each column, that may request a line.
    template <class Banks> void step(const Banks& columns) {
        const std::uint64_t all = buses_ == 64 ? ~std::uint64_t(0) : (std::uint64_t(1) << buses_) - 1;
        for (Announcement& announcement : announced_) announcement.isValid = false;

        // Nothing to do
        std::uint64_t requesters = 0;
        for (int column = 0; column < design_.columns; ++column)
            requesters |= static_cast<std::uint64_t>(columns(column).requestsLine()) << (column & 63);
        const bool hasData = hasLine_;
        if (requesters == 0 && !isWaiting_ && !buddyIsValid_ && !hasData && !isFilling_ && !isGathered_ && !gathers_ &&
            busy_ == 0) {
            isFresh_ = true;
            return;
        }

        const std::uint64_t free = all & ~busy_;
        const bool comes = hasData && !isFilling_;
        const Awaited& filled = awaited_[head_];
        const bool fills = comes && (filled.buses & ~free) == 0;
        const std::uint64_t usable = free & ~(comes ? filled.buses : 0);

        // Cycle d: compare
        const bool isLookedUp = isWaiting_ && isFresh_ && !fills;
        const int way = isLookedUp ? tags_.find(line_) : -1;
        int pending = -1;
        for (std::size_t i = 0; isLookedUp && way < 0 && i < awaited_.size(); ++i)
            if (awaited_[i].isUsed && awaited_[i].line == line_) pending = static_cast<int>(i);
        const bool delivers = way >= 0 && (asked_ & usable) != 0, joins = isLookedUp && way < 0 && pending >= 0;
        const bool enters = isLookedUp && way < 0 && pending < 0 && !awaited_[tail_].isUsed;
        const bool leaves = delivers || joins || enters || (isLookedUp && isBuddy_);

        // Cycle d - 1: accept a request
        const bool isVacant = !isWaiting_ || leaves;
        int granted = -1;
        if (requesters) {
            std::uint32_t eligible = 0;
            for (int column = 0; column < design_.columns; ++column) {
                const std::uint64_t bus = std::uint64_t(1) << (column / columnsPerBus);
                const bool willBeFree =
                    !(comes && (filled.buses & bus)) && ((busy_ & bus) != 0 || !(isWaiting_ && (asked_ & bus)));
                eligible |= static_cast<std::uint32_t>((requesters >> column & 1) && willBeFree) << column;
            }
            granted = arbiter_.grant(eligible);
        }

        // Announce
        const std::uint32_t announced = fills ? filled.line : line_;
        std::uint64_t starts = 0;
        if (fills || delivers) {
            std::uint64_t others = 0;
            for (int column = 0; column < design_.columns; ++column)
                if ((requesters >> column & 1) && columns(column).requestedLine() != announced)
                    others |= std::uint64_t(1) << (column / columnsPerBus);
            const std::uint64_t targets = fills ? filled.buses : asked_;
            if (targets) starts = targets | (usable & ~others);
        }
        for (std::uint64_t rest = starts; rest; rest &= rest - 1)
            announced_[static_cast<std::size_t>(__builtin_ctzll(rest))] = {announced, true};

        // Registers
        if (delivers) tags_.use(line_, way);
        if (joins) awaited_[static_cast<std::size_t>(pending)].buses |= asked_;
        const bool isBusy = used_ >= (awaited_.size() + 1) / 2;
        const std::uint32_t line = line_;
        const bool wasBuddy = isBuddy_;
        if (fills) {
            tags_.replace(filled.line, tags_.victim(filled.line));
            awaited_[head_].isUsed = false;
            head_ = after(head_);
            --used_;
        }
        if (enters) {
            awaited_[tail_] = {line, asked_, true, false};
            tail_ = after(tail_);
            ++used_;
        }
        const bool accepts = isVacant && (granted >= 0 || buddyIsValid_);
        isWaiting_ = accepts || (isWaiting_ && !leaves);
        if (accepts) {
            line_ = granted >= 0 ? columns(granted).requestedLine() : buddy_;
            asked_ = granted >= 0 ? std::uint64_t(1) << (granted / columnsPerBus) : 0;
            isBuddy_ = granted < 0;
            if (granted >= 0) {
                arbiter_.take(granted);
                columns(granted).takeLineRequest();
            } else buddyIsValid_ = false;
        }
        if (enters && !wasBuddy) {
            buddyIsValid_ = !isBusy;
            buddy_ = line ^ 1;
        }
        busy_ = starts;
        // The line that is held in front of the bank leaves while it is filled
        const bool leavesQueue = isFilling_;
        isFilling_ = fills;
        isFresh_ = !fills;
        if (leavesQueue) hasLine_ = false;
        if (isGathered_ && !hasLine_) {
            hasLine_ = true;
            isGathered_ = false;
        }
        if (gathers_) isGathered_ = true;
        gathers_ = false;
    }

    std::uint64_t dramReads = 0;

private:
    struct Awaited {
        std::uint32_t line = 0;
        std::uint64_t buses = 0;
        bool isUsed = false, isSent = false;
    };

    std::size_t after(std::size_t i) const { return i + 1 == awaited_.size() ? 0 : i + 1; }

    const Design& design_;
    int bank_, buses_;
    TagStore tags_;
    std::vector<Awaited> awaited_;
    std::size_t tail_ = 0, sender_ = 0, head_ = 0, used_ = 0;
    RoundRobin arbiter_;
    std::array<Announcement, maxBuses> announced_{};
    std::uint64_t busy_ = 0, asked_ = 0;
    std::uint32_t line_ = 0, buddy_ = 0;
    bool isWaiting_ = false, isBuddy_ = false, buddyIsValid_ = false, isFilling_ = false, isFresh_ = true,
         hasLine_ = false, isGathered_ = false, gathers_ = false;
};

} // namespace colonnade::cycles
