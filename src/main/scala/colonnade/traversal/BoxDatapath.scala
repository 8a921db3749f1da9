package colonnade.traversal

import chisel3._
import chisel3.util.RegEnable
import colonnade.config.ColonnadeConfig
import colonnade.numbers.Rounding

/** The interval of t in which a ray is inside a child's box, in units; empty if `tNear` exceeds `tFar`. */
final class BoxInterval(config: ColonnadeConfig) extends Bundle {
  val isOccupied = Bool()
  val tNear      = UInt((config.numbers.boxDistanceBits - 1).W)
  val tFar       = SInt(config.numbers.boxDistanceBits.W)

  def isEntered: Bool = isOccupied && tNear.zext <= tFar
}

/** Ports of [[BoxDatapath]]. */
final class BoxDatapathIO(config: ColonnadeConfig, lanes: Int) extends Bundle {
  val node = Input(new NodeOperands(config))

  /** New children are at the input. */
  val isValid   = Input(Bool())
  val children  = Input(Vec(lanes, new ChildPlanes(config)))
  val intervals = Output(Vec(lanes, new BoxInterval(config)))
}

/** Slab test of one ray against `lanes` boxes in padded integers (docs/numbers.md, section 3), without control logic.
  *
  * Latency [[BoxDatapath.latency]] cycles, throughput one set of boxes per cycle, no stalls. Each lane has four
  * multipliers, because the dominant axis needs none. A box beyond `tMax` has an empty interval. The registers of a lane
  * hold while it has no child to test.
  */
class BoxDatapath(config: ColonnadeConfig, lanes: Int) extends Module {
  private val numbers      = config.numbers
  private val distanceBits = numbers.boxDistanceBits
  private val pad          = BigInt(1) << numbers.boxPadLog
  require(
    numbers.boxPadLog <= numbers.vertexBits - 2,
    s"boxes are widened by 2^${numbers.boxPadLog} units; a quarter of the cube, 2^${numbers.vertexBits - 2}, is the most"
  )

  val io = IO(new BoxDatapathIO(config, lanes))

  // By stage: the children are valid; and the child of a lane is one to test
  private val isValid  = stages(io.isValid)
  private val isTested = io.children.map(child => stages(io.isValid && child.isOccupied))

  // Signed distances from the ray's origin to the planes of the padded box, along the ray's signs.
  // For a negative direction, -(corner + plane) ∓ pad is the complement of corner + plane ± pad - 1.
  private def widenedCorner(axis: Int, by: BigInt): SInt = {
    val constant = Mux(io.node.negative(axis), (-by - 1).S, by.S)
    Rounding.narrow(io.node.corner(axis) +& constant, numbers.vertexBits + 2) // at most 1.75 cubes
  }
  private val nearCorners = Seq.tabulate(3)(widenedCorner(_, -pad))
  private val farCorners  = Seq.tabulate(3)(widenedCorner(_, pad))

  private def distance(corners: Seq[SInt], planes: Vec[UInt], isTested: Bool)(axis: Int): SInt = {
    val plane  = Rounding.narrow(planes(axis) << io.node.exponent(axis), numbers.vertexBits + 1) // less than two cubes
    val upward = Rounding.narrow(corners(axis) +& plane.zext, distanceBits)                      // less than four
    RegEnable(Mux(io.node.negative(axis), ~upward, upward), isTested)
  }
  private def distances(corners: Seq[SInt], planes: ChildPlanes => Vec[UInt]) =
    io.children.zip(isTested).map { case (child, isTested) =>
      Seq.tabulate(3)(distance(corners, planes(child), isTested(0)))
    }
  private val tNears      = distances(nearCorners, _.nearPlanes)
  private val tFars       = distances(farCorners, _.farPlanes)
  private val reciprocals = RegEnable(io.node.reciprocal, isValid(0))
  private val tMax        = RegEnable(io.node.tMax, isValid(0))

  // Multiply by the reciprocals; along the dominant axis the distance is t already
  private def products(distances: Seq[Seq[SInt]]) = byLane(distances, stage = 1) { (lane, isTested) =>
    Seq.tabulate(2) { axis =>
      val exact = lane(axis) * reciprocals(axis).zext
      RegEnable(Rounding.narrow(exact, distanceBits + reciprocals(axis).getWidth), isTested)
    }
  }
  private val nearProducts  = products(tNears)
  private val farProducts   = products(tFars)
  private val dominantTNear = byLane(tNears, stage = 1)((tNear, isTested) => RegEnable(atLeastZero(tNear(2)), isTested))
  private val dominantTFar  = byLane(tFars, stage = 1)((tFar, isTested) => RegEnable(least(tFar(2), tMax), isTested))

  // Round to whole units
  private val shiftRight                      = RegEnable(RegEnable(io.node.shiftRight, isValid(0)), isValid(1))
  private val unitShift                       = Seq.tabulate(2)(axis => new UnitShift(shiftRight(axis), numbers))
  private def units(products: Seq[Seq[SInt]]) = byLane(products, stage = 2) { (lane, isTested) =>
    lane.zip(unitShift).map { case (product, shift) => RegEnable(shift(product), isTested) }
  }
  private val sideTNears = units(nearProducts)
  private val sideTFars  = units(farProducts)
  private val zTNears    = byLane(dominantTNear, stage = 2)(RegEnable(_, _))
  private val zTFars     = byLane(dominantTFar, stage = 2)(RegEnable(_, _))

  // Intersect the intervals of the three slabs
  for (lane <- 0 until lanes) {
    val interval  = Wire(new BoxInterval(config))
    val sideTNear = greatest(sideTNears(lane)(0), sideTNears(lane)(1))
    val sideTFar  = least(sideTFars(lane)(0), sideTFars(lane)(1))
    interval.isOccupied := isTested(lane)(3)
    interval.tNear      := greatest(sideTNear, zTNears(lane).zext).asUInt(distanceBits - 2, 0)
    // Floor rounds the side's tFar down, so add one unit; this cannot overflow because sideTFar < tFar
    interval.tFar      := Mux(sideTFar < zTFars(lane), Rounding.narrow(sideTFar +& 1.S, distanceBits), zTFars(lane))
    io.intervals(lane) := RegEnable(interval, isValid(3))
  }

  /** A flag in each stage: at the input, and after each register of the datapath but the last. */
  private def stages(flag: Bool): IndexedSeq[Bool] =
    Iterator.iterate(flag)(RegNext(_, false.B)).take(BoxDatapath.latency).toIndexedSeq

  /** The operands of each lane, with the enable of its registers in a stage. */
  private def byLane[T, R](operands: Seq[T], stage: Int)(register: (T, Bool) => R): Seq[R] =
    operands.zip(isTested).map { case (lane, flags) => register(lane, flags(stage)) }

  private def least(a: SInt, b: SInt): SInt = Mux(a < b, a, b)

  private def greatest(a: SInt, b: SInt): SInt = Mux(a < b, b, a)

  private def atLeastZero(x: SInt): UInt = Mux(x < 0.S, 0.U, x.asUInt(distanceBits - 2, 0))
}

object BoxDatapath {

  /** Cycles from operands to intervals. */
  val latency: Int = 4
}
