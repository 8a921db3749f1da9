package colonnade.traversal

import chisel3._
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
  val node      = Input(new NodeOperands(config))
  val children  = Input(Vec(lanes, new ChildPlanes(config)))
  val intervals = Output(Vec(lanes, new BoxInterval(config)))
}

/** Slab test of one ray against `lanes` boxes in padded integers (docs/numbers.md, section 3), without control logic.
  *
  * Latency [[BoxDatapath.latency]] cycles, throughput one set of boxes per cycle, no stalls. Each lane has four
  * multipliers, because the dominant axis needs none. A box beyond `tMax` has an empty interval.
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

  // Signed distances from the ray's origin to the planes of the padded box, along the ray's signs.
  // For a negative direction, -(corner + plane) ∓ pad is the complement of corner + plane ± pad - 1.
  private def widenedCorner(axis: Int, by: BigInt): SInt = {
    val constant = Mux(io.node.negative(axis), (-by - 1).S, by.S)
    Rounding.narrow(io.node.corner(axis) +& constant, numbers.vertexBits + 2) // at most 1.75 cubes
  }
  private val nearCorners = Seq.tabulate(3)(widenedCorner(_, -pad))
  private val farCorners  = Seq.tabulate(3)(widenedCorner(_, pad))

  private def distance(corners: Seq[SInt], planes: Vec[UInt])(axis: Int): SInt = {
    val plane  = Rounding.narrow(planes(axis) << io.node.exponent(axis), numbers.vertexBits + 1) // less than two cubes
    val upward = Rounding.narrow(corners(axis) +& plane.zext, distanceBits)                      // less than four
    registered(Mux(io.node.negative(axis), ~upward, upward))
  }
  private val tNears      = io.children.map(child => Seq.tabulate(3)(distance(nearCorners, child.nearPlanes)))
  private val tFars       = io.children.map(child => Seq.tabulate(3)(distance(farCorners, child.farPlanes)))
  private val reciprocals = registered(io.node.reciprocal)
  private val tMax        = registered(io.node.tMax)

  // Multiply by the reciprocals; along the dominant axis the distance is t already
  private def product(axis: Int)(distance: SInt): SInt = {
    val exact = distance * reciprocals(axis).zext
    registered(Rounding.narrow(exact, distanceBits + reciprocals(axis).getWidth))
  }
  private val nearProducts  = tNears.map(tNear => Seq.tabulate(2)(axis => product(axis)(tNear(axis))))
  private val farProducts   = tFars.map(tFar => Seq.tabulate(2)(axis => product(axis)(tFar(axis))))
  private val dominantTNear = tNears.map(tNear => registered(atLeastZero(tNear(2))))
  private val dominantTFar  = tFars.map(tFar => registered(least(tFar(2), tMax)))

  // Round to whole units
  private val shiftRight = registered(registered(io.node.shiftRight))
  private val unitShift  = Seq.tabulate(2)(axis => new UnitShift(shiftRight(axis), numbers))
  private val sideTNears = nearProducts.map(_.zip(unitShift).map { case (product, shift) =>
    registered(shift(product))
  })
  private val sideTFars = farProducts.map(_.zip(unitShift).map { case (product, shift) => registered(shift(product)) })

  // Intersect the intervals of the three slabs
  for (lane <- 0 until lanes) {
    val interval  = Wire(new BoxInterval(config))
    val sideTNear = greatest(sideTNears(lane)(0), sideTNears(lane)(1))
    val sideTFar  = least(sideTFars(lane)(0), sideTFars(lane)(1))
    val tNear     = greatest(sideTNear, registered(dominantTNear(lane)).zext)
    val tFar      = registered(dominantTFar(lane))
    interval.isOccupied := registered(registered(registered(io.children(lane).isOccupied)))
    interval.tNear      := tNear.asUInt(distanceBits - 2, 0)
    // Floor rounds the side's tFar down, so add one unit; this cannot overflow because sideTFar < tFar
    interval.tFar      := Mux(sideTFar < tFar, Rounding.narrow(sideTFar +& 1.S, distanceBits), tFar)
    io.intervals(lane) := registered(interval)
  }

  /** Delays by one cycle; unlike `RegNext`, it keeps the known width. */
  private def registered[T <: Data](x: T): T = {
    val register = Reg(chiselTypeOf(x))
    register := x
    register
  }

  private def least(a: SInt, b: SInt): SInt = Mux(a < b, a, b)

  private def greatest(a: SInt, b: SInt): SInt = Mux(a < b, b, a)

  private def atLeastZero(x: SInt): UInt = Mux(x < 0.S, 0.U, x.asUInt(distanceBits - 2, 0))
}

object BoxDatapath {

  /** Cycles from operands to intervals. */
  val latency: Int = 4
}
