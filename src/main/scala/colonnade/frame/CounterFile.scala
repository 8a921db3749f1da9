package colonnade.frame

import chisel3._
import chisel3.util.{log2Ceil, ShiftRegister}
import colonnade.config.ColonnadeConfig
import colonnade.formats.Counters

final class CounterFileIO(config: ColonnadeConfig) extends Bundle {

  /** By column, delayed by one cycle. */
  val events = Input(Vec(config.array.columns, new EventSums(config, 1)))

  /** With a cache: lines that are read from DRAM, and whether a read failed. */
  val dramReads   = config.columnBvhMemory.cache.map(_ => Input(UInt(log2Ceil(config.columnBvhMemory.banks + 1).W)))
  val memoryError = config.columnBvhMemory.cache.map(_ => Input(Bool()))

  /** A frame starts; count the events of this cycle. */
  val clear      = Input(Bool())
  val isCounting = Input(Bool())

  val counters = Output(new Counters(config))

  /** Sticky until cleared. */
  val stackOverflow = Output(Bool())
  val illegalRecord = Output(Bool())
  val isMemoryError = config.columnBvhMemory.cache.map(_ => Output(Bool()))
}

/** The counters and sticky errors of the array, over the cycles of `isCounting`.
  *
  * They are complete [[CounterFile.settleCycles]] cycles after the last counted one. Sums pass one register in each column
  * and one here, so no path both crosses the array and adds.
  */
final class CounterFile(config: ColonnadeConfig) extends Module {
  import CounterFile._

  val io = IO(new CounterFileIO(config))

  private val counters = RegInit(0.U.asTypeOf(new Counters(config)))
  private val overflow = RegInit(false.B)
  private val illegal  = RegInit(false.B)
  private val events   = RegNext(EventSums.ofArray(config, io.events))

  // Levels and errors lag behind events; units reset theirs some cycles after a frame starts.
  private val countsEvents = ShiftRegister(io.isCounting, eventStages, false.B, true.B)
  private val countsLevels = ShiftRegister(countsEvents, levelStages, false.B, true.B)

  private val sums = events.elements.toMap -- levels
  private val held = counters.elements

  when(io.clear) {
    counters := 0.U.asTypeOf(counters)
    overflow := false.B
    illegal  := false.B
  }.otherwise {
    when(io.isCounting) { counters.cycles := counters.cycles + 1.U }
    when(countsEvents) { for ((name, sum) <- sums) { held(name) := held(name).asUInt + sum.asUInt } }
    when(countsLevels && events.deepestStack > counters.deepestStack) { counters.deepestStack := events.deepestStack }
    when(countsEvents || countsLevels) {
      overflow := overflow || events.stackOverflow
      illegal  := illegal || events.illegalRecord
    }
  }

  // Reads from DRAM come from no column. An error counts until the device is idle
  for (reads <- io.dramReads; counter <- counters.dramReads) {
    when(io.clear) { counter := 0.U }.elsewhen(countsEvents) { counter := counter + reads }
  }
  for (error <- io.memoryError; output <- io.isMemoryError) {
    val failed = RegInit(false.B)
    failed := !io.clear && (failed || error)
    output := failed
  }

  io.counters      := counters
  io.stackOverflow := overflow
  io.illegalRecord := illegal
}

object CounterFile {
  private val eventStages = 2 // pipeline registers of the sums of events
  private val levelStages = 2 // cycles by which a unit's levels may lag behind its events

  private val levels = Set("deepestStack", "stackOverflow", "illegalRecord")

  val settleCycles: Int = eventStages + levelStages + 1
}
