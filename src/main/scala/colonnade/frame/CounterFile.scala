package colonnade.frame

import chisel3._
import chisel3.util.ShiftRegister
import colonnade.config.ColonnadeConfig
import colonnade.formats.Counters

/** Ports of [[CounterFile]]. */
final class CounterFileIO(config: ColonnadeConfig) extends Bundle {

  /** Of each column, one cycle after they happened. */
  val events = Input(Vec(config.array.columns, new EventSums(config, 1)))

  /** A frame begins. */
  val clear = Input(Bool())

  /** What happens in this cycle counts. */
  val isCounting = Input(Bool())

  val counters = Output(new Counters(config))

  /** Sticky until cleared. */
  val stackOverflow = Output(Bool())
  val illegalRecord = Output(Bool())
}

/** The array's counters and the errors of its units: of the cycles that count, and of those only.
  *
  * Complete [[CounterFile.settleCycles]] cycles after the last one that counted. Sums pass a register in each column and
  * another one here, so that no path crosses the array and adds as well.
  */
final class CounterFile(config: ColonnadeConfig) extends Module {
  import CounterFile._

  val io = IO(new CounterFileIO(config))

  private val counters = RegInit(0.U.asTypeOf(new Counters(config)))
  private val overflow = RegInit(false.B)
  private val illegal  = RegInit(false.B)
  private val events   = RegNext(EventSums.ofArray(config, io.events))

  // Levels and errors say the same for longer; units forget theirs some cycles after a frame begins.
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
    when(countsEvents) {
      for ((name, sum) <- sums) { held(name) := held(name).asUInt + sum.asUInt }
    }
    when(countsLevels && events.deepestStack > counters.deepestStack) { counters.deepestStack := events.deepestStack }
    when(countsEvents || countsLevels) {
      overflow := overflow || events.stackOverflow
      illegal  := illegal || events.illegalRecord
    }
  }

  io.counters      := counters
  io.stackOverflow := overflow
  io.illegalRecord := illegal
}

object CounterFile {

  /** Registers that sums of events pass on their way here. */
  private val eventStages = 2

  /** Cycles that a unit's levels may lag behind its events. */
  private val levelStages = 2

  private val levels = Set("deepestStack", "stackOverflow", "illegalRecord")

  val settleCycles: Int = eventStages + levelStages + 1
}
