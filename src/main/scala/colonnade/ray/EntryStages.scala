package colonnade.ray

import chisel3._
import chisel3.util.Fill
import colonnade.config.ColonnadeConfig
import colonnade.formats.Bounds
import colonnade.numbers.Rounding

final class EntryStagesIO(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers

  val loads  = Input(Vec(new SetupStages(numbers).count, Bool()))
  val bounds = Input(new Bounds(numbers))

  /** In [[SetupStages.fetchedRay]]. */
  val ray = Input(new PermutedRay(config))

  /** In [[SetupStages.reciprocals]]. */
  val reciprocals = Input(Vec(2, UInt(new RayFormats(numbers).reciprocal.width.W)))

  /** The entry, in units along z', in [[SetupStages.entry]]; a grid step may be longer than a unit. */
  val tNear = Output(UInt(numbers.entryBits.W))

  /** In [[SetupStages.enters]]. */
  val enters = Output(Bool())
}

/** Computes where a ray enters the object's box: a ray a cycle, one wide addition or one product a stage.
  *
  * Entries below 0 are equivalent to 0, so they are unsigned from stage to stage. An exit below 0 is a flag. The order of
  * the planes' distances, products, shifts and slacks is that of docs/numbers.md, section 2.6.
  */
final class EntryStages(config: ColonnadeConfig) extends Module {
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
  private val pad       = (BigInt(1) << numbers.boxPadLog).U
  private val lows      = PermutedFrame(io.bounds.low, axis).map(_.zext -& pad.zext)
  private val highs     = PermutedFrame(io.bounds.high, axis).map(_.zext +& pad.zext)
  private val distances = Seq.tabulate(3) { index =>
    def to(plane: SInt): SInt = {
      val forward = Mux(negative(index), origin(index), plane) -& Mux(negative(index), plane, origin(index))
      Rounding.narrow(forward, distanceBits)
    }
    (
      to(Mux(negative(index), highs(index), lows(index))),
      to(Mux(negative(index), lows(index), highs(index)))
    )
  }
  private val sides = distances.take(2).map { case (near, far) =>
    (load(near, stages.planes), load(far, stages.planes))
  }
  private val tNearAlong = load(positive(distances.last._1), stages.planes)
  private val tFarAlong  = {
    val far = distances.last._2
    Exit(load(far < 0.S || isNoRay, stages.planes), load(far.asUInt(entryBits - 1, 0), stages.planes))
  }

  // The sides have a second pad, for the error of their slopes; then the products
  private val slopePad = (tNearAlong >> numbers.vertexBits).zext
  private val products = sides.zip(io.reciprocals).map { case ((near, far), reciprocal) =>
    val nearest  = load(positive(Rounding.narrow(near -& slopePad, distanceBits)), stages.distances)
    val farthest = load(Rounding.narrow(far +& slopePad, distanceBits), stages.distances)
    (load(nearest * reciprocal, stages.products), load(farthest * reciprocal.zext, stages.products))
  }

  // In units along the ray, the exit rounded up; then widened by their relative error
  private val crossings = products.zip(drops).map { case ((near, far), drop) =>
    (load(Rounding.saturate(near >> drop, entryBits), stages.crossings), exitAfter(far >> drop, stages.crossings))
  }
  private val slack = numbers.entrySlackShift
  private val nears = crossings.map { case (near, _) => load(near - (near >> slack), stages.limits) }
  private val exits = crossings.map { case (_, exit) =>
    Exit(load(exit.isBelow0, stages.limits), load(exit.t +& (exit.t >> slack), stages.limits))
  }

  // The latest entry, before the earliest exit
  private val along       = hold(tNearAlong, stages.planes, stages.limits)
  private val Seq(x, y)   = nears
  private val latest      = Mux(x > y, Mux(x > along, x, along), Mux(y > along, y, along))
  private val tNear       = load(latest, stages.entry)
  private val exitsAtNear =
    exits.map(_.hold(stages.limits, stages.entry)) :+ tFarAlong.hold(stages.planes, stages.entry)
  io.tNear  := tNear
  io.enters := load(exitsAtNear.map(exit => !exit.isBelow0 && tNear <= exit.t).reduce(_ && _), stages.enters)

  /** An exit below 0, or at t; t is exact as far as an entry reaches. */
  private case class Exit(isBelow0: Bool, t: UInt) {
    def hold(from: Int, to: Int): Exit = Exit(registers.hold(isBelow0, from, to), registers.hold(t, from, to))
  }

  /** The exit one unit after t. */
  private def exitAfter(t: SInt, stage: Int): Exit = {
    val next   = t(entryBits - 1, 0) +& 1.U
    val beyond = t(t.getWidth - 1, entryBits)
    val isHuge = beyond.orR || next(entryBits)
    val below0 = t < 0.S && !(beyond.andR && next(entryBits))
    Exit(load(below0, stage), load(next(entryBits - 1, 0) | Fill(entryBits, isHuge), stage))
  }

  private def positive(t: SInt): UInt = Mux(t < 0.S, 0.U, t.asUInt)(entryBits - 1, 0)
}
