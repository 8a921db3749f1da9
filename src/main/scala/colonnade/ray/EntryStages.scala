package colonnade.ray

import chisel3._
import chisel3.util.{Decoupled, Fill}
import colonnade.common.TimingSlice
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.Bounds
import colonnade.numbers.Rounding

final class EntryStagesIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  val loads  = Input(Vec(new SetupStages(numbers).count, Bool()))
  val bounds = Input(new Bounds(numbers))

  /** In [[SetupStages.fetchedRay]], and in [[SetupStages.reciprocals]]. */
  val ray         = Input(new PermutedRay(config))
  val reciprocals = Input(Vec(2, UInt(new RayFormats(numbers).reciprocal.width.W)))

  /** The entry, in units along z', in [[SetupStages.entry]]; a grid step may be longer than a unit. */
  val tNear = Output(UInt(numbers.entryBits.W))

  val enters = Output(Bool()) // in [[SetupStages.enters]]
}

/** Computes where a ray enters the object's box: a ray a cycle, one wide addition or one product a stage.
  *
  * Entries below 0 are equivalent to 0, so they are unsigned from stage to stage. An exit below 0 is a flag. The order
  * of the planes' distances, products, shifts and slacks follows docs/numbers.md, section 2.6.
  */
final class EntryStages(config: PathConfig) extends Module {
  private val numbers      = config.numbers
  private val stages       = new SetupStages(numbers)
  private val entryBits    = numbers.entryBits
  private val distanceBits = entryBits + 1
  private val dropBits     = new RayFormats(numbers).exponentBits

  val io                = IO(new EntryStagesIO(config))
  private val registers = new StageRegisters(io.loads)
  import registers.{hold, load}

  private val info     = io.ray.info
  private val axis     = load(info.orientation.axis, stages.unitOrigins)
  private val negative = load(info.orientation.negative, stages.unitOrigins)
  private val isNoRay  = load(info.isZero.last, stages.unitOrigins)
  private val drops    = info.exponent.zip(info.isTiny).map { case (exponent, tiny) =>
    val bits = Mux(tiny, 0.U, numbers.reciprocalFraction.U - exponent)
    hold(load(bits(dropBits - 1, 0), stages.unitOrigins), stages.unitOrigins, stages.products)
  }

  // Distances from the origin in units to the padded planes; the sum of plane, origin and pads stays below 2^entryBits
  private val origin = io.ray.origin.map { position =>
    val units = Rounding.nearestEven(position.integer, numbers.gridFraction)
    load(Rounding.narrow(units, distanceBits), stages.unitOrigins)
  }
  private val pad        = (BigInt(1) << numbers.boxPadLog).U
  private val box        = PreparedRay.box(numbers, io.bounds, info.visit.map(load(_, stages.unitOrigins)))
  private val lows       = PermutedFrame(box.low, axis).map(_.zext -& pad.zext)
  private val highs      = PermutedFrame(box.high, axis).map(_.zext +& pad.zext)
  private val widthBits  = NumberFormats.bitLength((1L << numbers.vertexBits) + (2L << numbers.boxPadLog)) + 1
  private val widths     = highs.zip(lows).map { case (high, low) => Rounding.narrow(high -& low, widthBits) }
  private val nears      = planeDistances(lows, highs)
  private val fars       = planeDistances(highs, lows)
  private val tNearAlong = load(positive(nears.last), stages.planes)
  private val tFarAlong  = Exit(
    load(fars.last < 0.S || isNoRay, stages.planes),
    load(fars.last.asUInt(entryBits - 1, 0), stages.planes)
  )

  // The sides have a second pad, for the error of their slopes. Far planes follow from near ones and the box's width,
  // which is negative at inverted bounds
  private val slopePad = tNearAlong >> numbers.vertexBits
  private val products = Seq.tabulate(2) { side =>
    val near   = load(nears(side), stages.planes) -& slopePad.zext
    val width  = load(widths(side), stages.planes) +& (slopePad << 1).zext
    val factor = io.reciprocals(side)
    (
      load(load(Rounding.narrow(near, distanceBits), stages.distances) * factor.zext, stages.products),
      load(load(width, stages.distances) * factor.zext, stages.products)
    )
  }

  // In units along the ray; then widened by their relative error
  private val slack  = numbers.entrySlackShift
  private val tNears = products.zip(drops).map { case ((near, _), drop) =>
    val floored = near >> drop
    val t       = load(Rounding.saturate(Mux(floored < 0.S, 0.U, floored.asUInt), entryBits), stages.crossings)
    load(t - (t >> slack), stages.limits)
  }
  private val tFars = products.zip(drops).map { case ((near, width), drop) =>
    widenedExit(Rounding.narrow(near +& width, near.getWidth) >> drop)
  }

  // The latest entry, before the earliest exit
  private val Seq(x, y) = tNears
  private val z         = io.ray.limits.fold(hold(tNearAlong, stages.planes, stages.limits)) { limits =>
    val units = Rounding.saturate(Rounding.floor(limits.tMin, numbers.gridFraction), entryBits)
    val least = hold(load(units, stages.unitOrigins), stages.unitOrigins, stages.planes)
    hold(load(Mux(least > tNearAlong, least, tNearAlong), stages.distances), stages.distances, stages.limits)
  }
  private val tNear = load(Mux(x > y, Mux(x > z, x, z), Mux(y > z, y, z)), stages.entry)
  private val exits = tFars.map(_.hold(stages.limits, stages.entry)) :+ tFarAlong.hold(stages.planes, stages.entry)
  io.tNear  := tNear
  io.enters := load(exits.map(exit => !exit.isBelow0 && tNear <= exit.t).reduce(_ && _), stages.enters)

  /** An exit below 0, or at t; t is exact as far as an entry reaches. */
  private case class Exit(isBelow0: Bool, t: UInt) {
    def hold(from: Int, to: Int): Exit = Exit(registers.hold(isBelow0, from, to), registers.hold(t, from, to))
  }

  /** The exit one unit after a floored distance, with its slack: one addition for both. */
  private def widenedExit(floored: SInt): Exit = {
    val isBefore0 = floored < 0.S
    val isAt0     = floored.asUInt.andR
    val isHuge    = !isBefore0 && floored(floored.getWidth - 1, entryBits).orR
    val t         = load(floored(entryBits - 1, 0) | Fill(entryBits, isHuge), stages.crossings)
    val slackOf   = (t >> slack) +& t(slack - 1, 0).andR
    val widened   = Mux(load(isAt0, stages.crossings), 0.U, t +& slackOf + 1.U)
    Exit(load(load(isBefore0 && !isAt0, stages.crossings), stages.limits), load(widened, stages.limits))
  }

  /** From the origin forward to one of two planes, the second where the ray runs down the axis. */
  private def planeDistances(up: Seq[SInt], down: Seq[SInt]): Seq[SInt] =
    origin.zip(negative).zip(up.zip(down)).map { case ((from, isNegative), (upward, downward)) =>
      val distance = Mux(isNegative, from, upward) -& Mux(isNegative, downward, from)
      Rounding.narrow(distance, distanceBits)
    }

  private def positive(t: SInt): UInt = Mux(t < 0.S, 0.U, t.asUInt)(entryBits - 1, 0)
}

final class RayEntryIO(config: PathConfig) extends Bundle {
  val ray       = Flipped(Decoupled(new PermutedRay(config)))
  val quotients = Flipped(Decoupled(new SlopeQuotients(config)))
  val bounds    = Input(new Bounds(config.numbers))
  val output    = Decoupled(new PreparedRay(config))
  val busy      = Output(Bool())
}

/** Computes the distance at which a ray enters the object's box, and advances the ray's origin by it.
  *
  * A ray may come before its quotients, which must stay valid until they are accepted. If they are in time, the latency
  * is 10 + 2 · slices cycles (14 with a shear factor of two multiplier slices), or 12 for a ray that misses the
  * box; with `units.extraSlices` three more. The next ray is accepted in the cycle in which the result is taken.
  * Source: docs/numbers.md, sections 2.3 to 2.8.
  */
final class RayEntry(config: PathConfig) extends Module {
  val io = IO(new RayEntryIO(config))

  private val control  = Module(new EntryControl(EntryDatapath.slices(config), TimingSlice.extra(config.device)))
  private val datapath = Module(new EntryDatapath(config))

  control.io.rayValid       := io.ray.valid
  io.ray.ready              := control.io.rayReady
  control.io.quotientsValid := io.quotients.valid
  io.quotients.ready        := control.io.quotientsReady
  io.output.valid           := control.io.outputValid
  control.io.outputReady    := io.output.ready
  control.io.enters         := datapath.io.enters
  io.busy                   := control.io.busy

  datapath.io.command   := control.io.command
  datapath.io.ray       := io.ray.bits
  datapath.io.quotients := io.quotients.bits
  datapath.io.bounds    := io.bounds
  io.output.bits        := datapath.io.output
}
