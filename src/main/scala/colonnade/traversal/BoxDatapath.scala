package colonnade.traversal

import chisel3._
import colonnade.config.ColonnadeConfig
import colonnade.numbers.Rounding

/** Where a ray is within a child's box, in units; nothing when `near` is beyond `far`. */
final class BoxInterval(config: ColonnadeConfig) extends Bundle {
  val isOccupied = Bool()
  val near       = UInt((config.numbers.boxDistanceBits - 1).W)
  val far        = SInt(config.numbers.boxDistanceBits.W)

  def isEntered: Bool = isOccupied && near.zext <= far
}

/** Ports of [[BoxDatapath]]. */
final class BoxDatapathIO(config: ColonnadeConfig, lanes: Int) extends Bundle {
  val node      = Input(new NodeOperands(config))
  val children  = Input(Vec(lanes, new ChildPlanes(config)))
  val intervals = Output(Vec(lanes, new BoxInterval(config)))
}

/** Slab test of one ray against `lanes` boxes in padded integers (docs/numbers.md, section 3), without control.
  *
  * Latency [[BoxDatapath.latency]] cycles, a set of boxes each cycle; it never stalls. Four multipliers a lane: the
  * dominant axis needs none. A box beyond the limit comes out with `far` before `near`.
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

  // Distances of the planes from the ray's origin, along the ray's signs, the box widened.
  // Where the ray goes down, -(corner + plane) ∓ pad is the complement of corner + plane ± pad - 1.
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
  private val nears       = io.children.map(child => Seq.tabulate(3)(distance(nearCorners, child.near)))
  private val fars        = io.children.map(child => Seq.tabulate(3)(distance(farCorners, child.far)))
  private val reciprocals = registered(io.node.reciprocal)
  private val limit       = registered(io.node.limit)

  // Times the reciprocals; the dominant axis is a distance already
  private def product(axis: Int)(distance: SInt): SInt = {
    val exact = distance * reciprocals(axis).zext
    registered(Rounding.narrow(exact, distanceBits + reciprocals(axis).getWidth))
  }
  private val nearProducts = nears.map(near => Seq.tabulate(2)(axis => product(axis)(near(axis))))
  private val farProducts  = fars.map(far => Seq.tabulate(2)(axis => product(axis)(far(axis))))
  private val dominantNear = nears.map(near => registered(atLeastZero(near(2))))
  private val dominantFar  = fars.map(far => registered(least(far(2), limit)))

  // Whole units
  private val drop      = registered(registered(io.node.drop))
  private val unitShift = Seq.tabulate(2)(axis => new UnitShift(drop(axis), numbers))
  private val sideNears = nearProducts.map(_.zip(unitShift).map { case (product, shift) => registered(shift(product)) })
  private val sideFars  = farProducts.map(_.zip(unitShift).map { case (product, shift) => registered(shift(product)) })

  // The interval in which the ray is within all slabs
  for (lane <- 0 until lanes) {
    val interval = Wire(new BoxInterval(config))
    val sideNear = greatest(sideNears(lane)(0), sideNears(lane)(1))
    val sideFar  = least(sideFars(lane)(0), sideFars(lane)(1))
    val near     = greatest(sideNear, registered(dominantNear(lane)).zext)
    val far      = registered(dominantFar(lane))
    interval.isOccupied := registered(registered(registered(io.children(lane).isOccupied)))
    interval.near       := near.asUInt(distanceBits - 2, 0)
    // One is added to a side's far, which floor has made too small; below `far` that can't overflow
    interval.far       := Mux(sideFar < far, Rounding.narrow(sideFar +& 1.S, distanceBits), far)
    io.intervals(lane) := registered(interval)
  }

  /** One cycle later; unlike `RegNext`, as wide as it is known to be. */
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
