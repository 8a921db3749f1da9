// The device as coupled Verilator models of unit, column and device.
// simulator_sources.py, which writes coupling.hpp, explains the coupling and the properties of the RTL that it needs.
#pragma once
#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "VColonnade.h"
#include "VColonnade___024root.h"
#include "VColumn.h"
#include "VColumn___024root.h"
#include "VUnitModel.h"
#include "coupling.hpp"
#ifdef WAVEFORM
#include "verilated_vcd_c.h"
#endif

/// Copies or compares a port between `variables` of the outer model and the `inner` model.
#define INWARD(port) inner.port = *variables.port;
#define OUTWARD(port) *variables.port = inner.port;
#define REQUIRE_EQUAL(port) requireEqual(*variables.port, inner.port, #port);

class Array {
public:
    /// The top model. Set its inputs before `settle`, read its outputs after it.
    VColonnade device;

    Array() : columnVariables_(bindColumn(*device.rootp)) {
        for (std::size_t i = 0; i < columnVariables_.size(); ++i) {
            columns_.push_back(std::make_unique<VColumn>());
            for (const UnitVariables& variables : bindUnit(*columns_.back()->rootp)) {
                unitVariables_.push_back(variables);
                units_.push_back(std::make_unique<VUnitModel>());
                units_.back()->eval();
            }
            columns_.back()->eval();
        }
        for (std::size_t i = 0; i < units_.size(); ++i) { // constants, too
            const UnitVariables& variables = unitVariables_[i];
            VUnitModel& inner = *units_[i];
            Unit_INPUTS(INWARD)
        }
    }
    ~Array() {
        for (auto& unit : units_) unit->final();
        for (auto& column : columns_) column->final();
        device.final();
    }

    /// Propagates all combinational values of this cycle.
    void settle() {
        device.eval();
        for (std::size_t i = 0; i < units_.size(); ++i) {
            const UnitVariables& variables = unitVariables_[i];
            const VUnitModel& inner = *units_[i];
            Unit_OUTPUTS(OUTWARD)
        }
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            const ColumnVariables& variables = columnVariables_[i];
            VColumn& inner = *columns_[i];
            Column_DIRECT(INWARD)
            Column_INPUTS(INWARD)
            inner.eval();
            Column_OUTPUTS(OUTWARD)
        }
        device.eval();
        intoColumns();
        for (std::size_t i = 0; i < units_.size(); ++i) {
            const UnitVariables& variables = unitVariables_[i];
            VUnitModel& inner = *units_[i];
            Unit_DIRECT(INWARD)
        }
    }

    /// The clock edge after `settle`. Frame registers are copied only while they may change.
    void edge(bool mayChangeRegisters) {
        outerEdge(mayChangeRegisters);
        unitsEdge(mayChangeRegisters);
    }

    /// A cycle of device and columns without the units: for loads, which do not affect idle units.
    void outerCycle() {
        device.eval();
        intoColumns();
        outerEdge(true);
    }

    /// A clock edge of the units alone, to catch up with cycles of `outerCycle`.
    void unitsEdge(bool mayChangeRegisters) {
        for (std::size_t i = 0; i < units_.size(); ++i) {
            const UnitVariables& variables = unitVariables_[i];
            VUnitModel& inner = *units_[i];
            Unit_INPUTS(INWARD)
            if (mayChangeRegisters) { Unit_REGISTERS(INWARD) }
            flip(inner);
        }
    }

    /// Writes a record into the memory of each column, as the load port does. Addresses beyond the depth are ignored.
    void store(std::uint64_t address, const void* record, std::size_t bytes) {
        for (auto& column : columns_) {
            unsigned bank = 0;
#define STORE(memory) storeInBank(column->rootp->memory, bank++, address, record, bytes);
            RECORD_BANKS(STORE)
#undef STORE
        }
    }

    /// Throws if another evaluation after `settle` changes a coupled port.
    void check() {
        for (std::size_t i = 0; i < units_.size(); ++i) {
            const UnitVariables& variables = unitVariables_[i];
            VUnitModel& inner = *units_[i];
            inner.eval();
            Unit_OUTPUTS(REQUIRE_EQUAL)
        }
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            const ColumnVariables& variables = columnVariables_[i];
            VColumn& inner = *columns_[i];
            inner.eval();
            Column_OUTPUTS(REQUIRE_EQUAL)
            Column_REGISTERS(REQUIRE_EQUAL)
        }
        for (std::size_t i = 0; i < units_.size(); ++i) {
            const UnitVariables& variables = unitVariables_[i];
            const VUnitModel& inner = *units_[i];
            Unit_DIRECT(REQUIRE_EQUAL)
            Unit_INPUTS(REQUIRE_EQUAL)
            Unit_REGISTERS(REQUIRE_EQUAL)
        }
    }

#ifdef WAVEFORM
    /// Adds the device, its first column and that column's first unit to a waveform before it is opened.
    void addTo(VerilatedVcdC& waveform) {
        device.trace(&waveform, 99);
        columns_.front()->trace(&waveform, 99);
        units_.front()->trace(&waveform, 99);
    }

    /// Evaluates again what `addTo` adds: after `settle`, some of its inputs are newer than its other signals.
    void settleTraced() {
        columns_.front()->eval();
        units_.front()->eval();
    }
#endif

private:
    void intoColumns() {
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            const ColumnVariables& variables = columnVariables_[i];
            VColumn& inner = *columns_[i];
            Column_DIRECT(INWARD)
            Column_INPUTS(INWARD)
        }
    }

    void outerEdge(bool mayChangeRegisters) {
        flip(device);
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            const ColumnVariables& variables = columnVariables_[i];
            VColumn& inner = *columns_[i];
            // Before the edge: the column passes them on to its units
            if (mayChangeRegisters) { Column_REGISTERS(INWARD) }
            flip(inner);
        }
    }

    template <class Model> static void flip(Model& model) {
        model.clock = !model.clock;
        model.eval();
    }

    template <class Value> static void requireEqual(const Value& outer, const Value& inner, const char* port) {
        if (std::memcmp(&outer, &inner, sizeof outer) != 0) throw std::runtime_error(std::string("the simulator's models disagree on port ") + port);
    }

    template <class Memory> static void storeInBank(Memory& memory, unsigned bank, std::uint64_t address, const void* record, std::size_t bytes) {
        if (address % banksOfColumn != bank) return;
        const std::uint64_t row = address / banksOfColumn;
        if (row < sizeof memory / sizeof memory[0]) std::memcpy(&memory[row], record, bytes);
    }

    std::vector<std::unique_ptr<VColumn>> columns_;
    std::vector<std::unique_ptr<VUnitModel>> units_;
    std::vector<ColumnVariables> columnVariables_;
    std::vector<UnitVariables> unitVariables_;
};

#undef INWARD
#undef OUTWARD
#undef REQUIRE_EQUAL
