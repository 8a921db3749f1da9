// When DRAM answers a read: after a constant latency, or by the rows that its banks hold open.
#pragma once
#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

class DramTiming {
public:
    virtual ~DramTiming() = default;

    /// The cycle from which the data of a read of so many bytes, accepted in cycle `now`, may leave; calls are in the
    /// order of the reads.
    virtual std::uint64_t due(std::uint64_t now, std::uint64_t address, unsigned bytes) = 0;
};

class ConstantLatency final : public DramTiming {
public:
    explicit ConstantLatency(unsigned latency) : latency_(latency) {}
    std::uint64_t due(std::uint64_t now, std::uint64_t, unsigned) override { return now + latency_; }

private:
    std::uint64_t latency_;
};

/// DDR3-1600 with 64 data pins behind a controller of 200 MHz, in its cycles of 5 ns (JESD79-3, devices of 4 Gbit).
///
/// A cycle moves one burst of 64 bytes, in the order of the reads. Addresses are row, bank, column. Each bank opens the
/// row of its next read while others deliver. A read of an open row takes `latency` cycles, without one also an
/// activation, of another row also a precharge.
class BankedDram final : public DramTiming {
public:
    static constexpr std::uint64_t rowBytes = 8192, burstBytes = 64;
    static constexpr std::uint64_t precharge = 3, rowToColumn = 3, rowActive = 7, readToPrecharge = 2;
    static constexpr std::uint64_t rowToRow = 2, fourRows = 6, refreshTime = 52, refreshInterval = 1560;

    BankedDram(unsigned banks, unsigned latency) : latency_(latency), banks_(banks) {}

    std::uint64_t due(std::uint64_t now, std::uint64_t address, unsigned bytes) override {
        const std::uint64_t page = address / rowBytes, row = page / banks_.size();
        Bank& bank = banks_[page % banks_.size()];
        while (std::max({now, bank.ready, bus_}) >= refresh_) refresh();
        std::uint64_t column = std::max(now, bank.ready);
        if (bank.row != row) {
            const std::uint64_t closed = bank.row == none ? column : std::max(column, bank.closable) + precharge;
            const std::uint64_t opened = std::max({closed, rows_[0] + fourRows, rows_[3] + rowToRow});
            std::rotate(rows_, rows_ + 1, rows_ + 4);
            rows_[3] = opened;
            bank.row = row;
            bank.closable = opened + rowActive;
            column = opened + rowToColumn;
        }
        column = std::max(column, bus_);
        bus_ = column + (address % burstBytes + bytes + burstBytes - 1) / burstBytes;
        bank.closable = std::max(bank.closable, bus_ - 1 + readToPrecharge);
        return column + latency_;
    }

private:
    static constexpr std::uint64_t none = ~std::uint64_t(0);

    struct Bank {
        std::uint64_t row = none, ready = 0, closable = 0;
    };

    /// Closes all rows, and blocks all banks, at the time of the next refresh.
    void refresh() {
        std::uint64_t closed = refresh_;
        for (const Bank& bank : banks_)
            if (bank.row != none) closed = std::max(closed, bank.closable);
        for (Bank& bank : banks_) bank = {none, closed + precharge + refreshTime, 0};
        refresh_ += refreshInterval;
    }

    std::uint64_t latency_, bus_ = 0, refresh_ = refreshInterval;
    std::uint64_t rows_[4] = {}; // the last activations, the oldest first
    std::vector<Bank> banks_;
};

/// With 0 banks the latency is constant.
inline std::unique_ptr<DramTiming> dramTiming(unsigned banks, unsigned latency) {
    if (banks == 0) return std::make_unique<ConstantLatency>(latency);
    return std::make_unique<BankedDram>(banks, latency);
}
