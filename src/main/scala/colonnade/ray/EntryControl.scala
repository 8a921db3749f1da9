package colonnade.ray

import chisel3._
import chisel3.util.log2Ceil

/** Control signals of the [[EntryDatapath]] for one cycle; `side` is 0 for x', 1 for y'. */
final class EntryCommand(slices: Int) extends Bundle {

  /** Load a new ray. */
  val loads = Bool()

  /** Round the first axis of the origin to units. */
  val roundsOrigin = Bool()

  /** Rotate the axes of the origin without a change. */
  val rotatesOrigin = Bool()

  /** Compute the distance to the near (`crossesFar`: far) plane of the axis whose origin was rounded. */
  val crosses      = Bool()
  val crossesFar   = Bool()
  val crossesSide  = Bool()
  val crossingSide = UInt(1.W)

  /** The last distance belongs to the dominant axis's near plane, or far plane. */
  val takesAlongNear = Bool()
  val takesAlongFar  = Bool()

  /** The quotients are valid: load both reciprocals and the first shear factor, then the second one. */
  val takesReciprocals = Bool()
  val takesShear       = Bool()
  val shearSide        = UInt(1.W)

  /** Multiply the last distance by a reciprocal, or the entry distance by a slice of a shear factor. */
  val multipliesShear = Bool()
  val multiplySide    = UInt(1.W)
  val slice           = UInt(log2Ceil(slices.max(2)).W)

  /** Scale the last product to a distance along the ray; one cycle later clip the entry or exit distance with it. */
  val scales    = Bool()
  val scalesFar = Bool()
  val scaleSide = UInt(1.W)
  val limits    = Bool()
  val limitsFar = Bool()

  /** Advance the first axis of the origin to the entry point, and rotate the axes. */
  val advancesAlong = Bool()
  val advancesSide  = Bool()
}

final class EntryControlIO(slices: Int) extends Bundle {
  val rayValid       = Input(Bool())
  val rayReady       = Output(Bool())
  val quotientsValid = Input(Bool())
  val quotientsReady = Output(Bool())
  val outputValid    = Output(Bool())
  val outputReady    = Input(Bool())

  /** The ray intersects the box; valid when all axes are done. */
  val enters  = Input(Bool())
  val command = Output(new EntryCommand(slices))
  val busy    = Output(Bool())
}

/** Sequences [[RayEntry]]: three steps for the dominant axis, a wait for the quotients, then both sides, then the advance.
  *
  * The sides are pipelined: each cycle one plane starts distance, product, scaling and clipping. Their order is near x',
  * near y', far y', far x', so that the advance starts while the exit distance is still computed. The advance takes
  * `slices` cycles per side; a ray that misses the box skips it.
  */
final class EntryControl(slices: Int) extends Module {
  val io = IO(new EntryControlIO(slices))

  private val quotients = 3
  private val decided   = 10
  private val advance   = 8
  private val last      = advance + 2 * slices
  private val finished  = last + 1

  private val busy = RegInit(false.B)
  private val step = Reg(UInt(log2Ceil(finished + 1).W))

  private def at(steps: Int*): Bool = busy && steps.map(step === _.U).reduce(_ || _)

  private val waits = at(quotients) && !io.quotientsValid

  io.busy           := busy
  io.outputValid    := at(finished)
  io.rayReady       := !busy || (io.outputValid && io.outputReady)
  io.quotientsReady := at(quotients + 1)

  private val follows = Mux(at(decided) && !io.enters, finished.U, step + 1.U)
  private val next    = Mux(io.command.loads, 0.U, Mux(busy && !waits && !io.outputValid, follows, step))
  step := next
  when(io.outputValid && io.outputReady) { busy := false.B }
  when(io.command.loads) { busy := true.B }

  // The multiplier's operands are selected one cycle early, for timing
  private val shears     = RegNext(next >= advance.U)
  private val shearsLast = next >= (advance + slices).U
  private val side       = RegNext(Mux(next >= advance.U, shearsLast, next === 5.U || next === 6.U).asUInt)
  private val slice      =
    RegNext((next - Mux(shearsLast, (advance + slices).U, advance.U))(io.command.slice.getWidth - 1, 0))

  private val command = io.command
  command.loads            := io.rayValid && io.rayReady
  command.roundsOrigin     := at(0, 2, 5) || command.takesReciprocals
  command.rotatesOrigin    := command.roundsOrigin || at(4, 6)
  command.crosses          := at(1, 2, 4, 5, 6) || command.takesReciprocals
  command.crossesFar       := at(2, 5, 6)
  command.crossesSide      := !at(1, 2)
  command.crossingSide     := at(4, 5).asUInt
  command.takesAlongNear   := at(2)
  command.takesAlongFar    := command.takesReciprocals
  command.takesReciprocals := at(quotients) && io.quotientsValid
  command.takesShear       := command.takesReciprocals || at(quotients + 1)
  command.shearSide        := at(quotients + 1).asUInt
  command.multipliesShear  := shears
  command.multiplySide     := side
  command.slice            := slice
  command.scales           := at(5, 6, 7, 8)
  command.scalesFar        := at(7, 8)
  command.scaleSide        := at(6, 7).asUInt
  command.limits           := at(6, 7, 8, 9)
  command.limitsFar        := at(8, 9)
  command.advancesAlong    := at(advance)
  command.advancesSide     := at(advance + slices, last)
}
