package colonnade.ray

import chisel3._
import chisel3.util.log2Ceil
import colonnade.common.TimingSlice

/** Control signals of the [[EntryDatapath]] for one cycle; `side` is 0 for x', 1 for y'. */
final class EntryCommand(slices: Int) extends Bundle {
  val loads = Bool() // load a new ray

  /** Round the first axis of the origin to units; rotate its axes without a change. */
  val roundsOrigin  = Bool()
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

  /** The side of the shear factor that is taken: `shearSide`, or its value in the cycle before. */
  val takenSide = UInt(1.W)

  /** Multiply the last distance by a reciprocal, or the entry distance by a slice of a shear factor. */
  val multipliesShear = Bool()
  val multiplySide    = UInt(1.W)
  val slice           = UInt(log2Ceil(slices.max(2)).W)

  /** Scale the last product to a distance along the ray; one cycle later clip the entry or exit distance with it. */
  val scales    = Bool()
  val scalesFar = Bool()

  val boundsFar = Bool() // what is scaled limits the exit
  val limits    = Bool()
  val limitsFar = Bool()

  /** The next cycle scales a shear factor; and the side of what it scales. */
  val scalesShearNext = Bool()
  val scaleSideNext   = UInt(1.W)

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

/** Sequences [[RayEntry]]: three steps for the dominant axis, a wait for the quotients, then both sides, then the
  * advance.
  *
  * The sides are pipelined: each cycle one plane starts distance, product, scaling and clipping. Their order is near
  * x', near y', far y', far x', so that the advance starts while the exit distance is still computed. The advance takes
  * `slices` cycles per side; a ray that misses the box skips it. With extra `timing` slices the operands of products
  * and what was scaled are registered, and what follows comes later.
  */
final class EntryControl(slices: Int, timing: TimingSlice) extends Module {
  val io = IO(new EntryControlIO(slices))

  private val quotients = 3
  private val delay     = 2 * timing.cycles // of products
  private val scaling   = timing.cycles     // of what was scaled
  private val limiting  = timing.cycles     // of what limits entry and exit
  private val rounding  = timing.cycles     // of what moves the origin sideways
  private val deciding  = timing.cycles     // of whether the ray enters
  private val decided   = 10 + delay + scaling + limiting + deciding
  private val advance   = 8 + delay + scaling + limiting
  private val last      = advance + 2 * slices + delay + rounding
  private val finished  = last + 1

  private val busy = RegInit(false.B)
  private val step = Reg(UInt(log2Ceil(finished + 1).W))

  private def at(steps: Int*): Bool = busy && steps.map(step === _.U).reduce(_ || _)

  /** At these steps, but when products and what was scaled are late. */
  private def late(steps: Int*): Bool = at(steps.map(_ + delay + scaling): _*)

  private val waits = at(quotients) && !io.quotientsValid

  // Registers of their own: the paths of `rayReady` and `quotientsReady` lead up to the tiles
  private val isFinished = RegInit(false.B)
  private val isTaking   = RegInit(false.B)

  io.busy           := busy
  io.outputValid    := busy && isFinished
  io.rayReady       := !busy || (io.outputValid && io.outputReady)
  io.quotientsReady := busy && isTaking

  private val enters  = timing(io.enters)
  private val follows = Mux(at(decided) && !enters, finished.U, step + 1.U)
  private val next    = Mux(io.command.loads, 0.U, Mux(busy && !waits && !io.outputValid, follows, step))
  step       := next
  isFinished := next === finished.U
  isTaking   := next === (quotients + 1).U
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
  command.takesShear       := timing.flag(command.takesReciprocals || at(quotients + 1))
  command.shearSide        := at(quotients + 1).asUInt
  command.takenSide        := at(quotients + 1 + scaling).asUInt
  command.multipliesShear  := shears
  command.multiplySide     := side
  command.slice            := slice
  command.scales           := late(5, 6, 7, 8)
  command.scalesFar        := late(7, 8)
  command.scalesShearNext  := next <= (quotients + 1).U
  command.scaleSideNext    := (next === (quotients + 1).U || next === (6 + delay).U || next === (7 + delay).U).asUInt
  command.boundsFar        := late(8, 9)
  command.limits           := late(Seq(6, 7, 8, 9).map(_ + limiting): _*)
  command.limitsFar        := late(Seq(8, 9).map(_ + limiting): _*)
  command.advancesAlong    := at(advance)
  command.advancesSide     := at(last - slices, last)
}
