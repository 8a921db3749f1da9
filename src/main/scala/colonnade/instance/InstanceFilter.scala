package colonnade.instance

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, RegEnable}
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.ObjectBox
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.{PermutedFrame, PreparedRay, RayFormats}

/** A ray of the world and the instances whose boxes it enters before `tMax`, a bit each. */
final class EnteredBoxes(config: PathConfig) extends Bundle {
  val context  = Context(config)
  val isShadow = Bool()
  val tMax     = new Fixed(new RayFormats(config.numbers).grid)
  val mask     = UInt(config.device.frame.instances.W)
}

final class InstanceFilterIO(config: PathConfig) extends Bundle {
  private val instances = config.device.frame.instances

  /** Constant while a ray is in the unit; the first `count` are on, at least one. */
  val boxes = Input(Vec(instances, new ObjectBox))
  val count = Input(UInt(NumberFormats.bitLength(instances).W))

  val ray     = Flipped(Decoupled(new PreparedRay(config)))
  val entered = Decoupled(new EnteredBoxes(config))
}

/** Finds the instances whose boxes a ray may enter, eight a cycle, with positions in cells and slopes of 6 bits: never
  * fewer than in exact arithmetic. Latency: four cycles for up to eight instances. Source: docs/numbers.md, section 10.
  */
final class InstanceFilter(config: PathConfig) extends Module {
  import InstanceFilter._

  private val numbers   = config.numbers
  private val instances = config.device.frame.instances
  private val lanes     = 1 << log2Ceil(instances.min(maxLanes))
  private val groups    = (instances + lanes - 1) / lanes
  private val dropBits  = numbers.vertexBits + numbers.gridFraction - ObjectBox.cellBits

  val io = IO(new InstanceFilterIO(config))

  // Stages hold while the last group of a ray is not taken
  private val moves   = !io.entered.valid || io.entered.ready
  private val isHeld  = RegInit(false.B)
  private val group   = RegInit(0.U(log2Ceil(groups.max(2)).W))
  private val isLast  = group === ((io.count - 1.U) >> log2Ceil(lanes))
  private val accepts = io.ray.valid && io.ray.ready
  io.ray.ready := moves && (!isHeld || isLast)
  when(io.ray.ready) { isHeld := io.ray.valid }
  when(moves && isHeld) { group := Mux(isLast, 0.U, group + 1.U) }

  /** A value of a stage in the next one. */
  private def next[T <: Data](value: T): T = RegEnable(value, moves)

  // Stage 0: the ray in cells
  private val ray    = io.ray.bits.ray
  private val common = Wire(new RayInFilter)
  private val limit  = (io.ray.bits.tMax.integer.asUInt >> dropBits) +& 1.U
  common.context  := io.ray.bits.context
  common.isShadow := io.ray.bits.isShadow
  common.tMax     := io.ray.bits.tMax
  common.limit    := Rounding.saturate(limit, moveBits)
  common.slopes.zip(ray.shear).foreach { case (to, shear) =>
    val steep = (shear.integer >> (numbers.shearFraction - slopeBits)).asUInt(slopeBits, 0)
    to := Mux(shear.integer < 0.S, ~steep, steep)
  }
  private val ray0     = RegEnable(common, accepts)
  private val axis     = RegEnable(ray.orientation.axis, accepts)
  private val negative =
    RegEnable(VecInit(ray.shear.map(_.integer < 0.S).toSeq :+ ray.orientation.negative(2)), accepts)
  private val origin = RegEnable(VecInit(ray.origin.map(each => (each.integer >> dropBits).asSInt)), accepts)

  // Stage 1: distances to the near and the far plane along each axis, rounded outwards
  private val ray1  = next(ray0)
  private val boxes = Seq.tabulate(lanes) { lane =>
    val boxes  = Seq.tabulate(groups)(each => io.boxes((lanes * each + lane).min(instances - 1)))
    val box    = if (groups == 1) boxes.head else VecInit(boxes)(group)
    val isOn   = (group ## lane.U(log2Ceil(lanes).W)) < io.count
    val low    = PermutedFrame(box.low, axis)
    val high   = PermutedFrame(box.high, axis)
    val planes = Seq.tabulate(3) { i =>
      val (from, up, down) = (origin(i), low(i).zext, high(i).zext)
      val near             = Mux(negative(i), from, up) +& ~Mux(negative(i), down, from) // their difference minus 1
      val far              = Mux(negative(i), from +& 1.S, down) -& Mux(negative(i), up, from -& 1.S)
      (next(near), next(far))
    }
    (next(isOn), planes)
  }

  // Stage 2: what the ray moves sideways up to its entry and to its exit along z'
  private val ray2   = next(ray1)
  private val passes = boxes.map { case (isOn, planes) =>
    val (near, far) = planes.last
    val isBefore    = near > ray1.limit.zext
    val entry       = Mux(near < 0.S, 0.U, near.asUInt(moveBits - 1, 0))
    val exit        = Mux(far > ray1.limit.zext, ray1.limit, far.asUInt(moveBits - 1, 0))
    val sides       = ray1.slopes.zip(planes).map { case (slope, (near, far)) =>
      val least = (entry * slope) >> slopeBits
      val most  = (exit * (slope +& 1.U)) >> slopeBits
      (next(least), next(most), next(near), next(far))
    }
    (next(isOn && !isBefore && far >= 0.S), sides)
  }

  // The mask: groups before the last one wait
  private val meets = passes.map { case (mayMeet, sides) =>
    mayMeet && sides.map { case (least, most, near, far) => least.zext <= far && most.zext +& 1.S >= near }.reduce(
      _ && _
    )
  }
  private val holds   = RegInit(VecInit(false.B, false.B))
  private val isLast2 = next(next(isLast))
  private val group2  = next(next(group))
  when(moves) {
    holds(0) := isHeld
    holds(1) := holds(0)
  }
  private val before = RegInit(0.U(instances.W))
  private val bits   = VecInit(meets).asUInt
  private val mask   = before | Cat((0 until groups).reverse.map(each => Mux(group2 === each.U, bits, 0.U(lanes.W))))
  when(moves && holds(1)) { before := Mux(isLast2, 0.U, mask) }
  io.entered.valid         := holds(1) && isLast2
  io.entered.bits.context  := ray2.context
  io.entered.bits.isShadow := ray2.isShadow
  io.entered.bits.tMax     := ray2.tMax
  io.entered.bits.mask     := mask

  /** What stages need of a ray. */
  private final class RayInFilter extends Bundle {
    val context  = Context(config)
    val isShadow = Bool()
    val tMax     = new Fixed(new RayFormats(numbers).grid)
    val limit    = UInt(moveBits.W)
    val slopes   = Vec(2, UInt((slopeBits + 1).W))
  }
}

private object InstanceFilter {
  val maxLanes:  Int = 8
  val slopeBits: Int = 6

  /** Of a distance in cells from an origin that lies at most half a cube outside. */
  val moveBits: Int = ObjectBox.cellBits + 2
}
