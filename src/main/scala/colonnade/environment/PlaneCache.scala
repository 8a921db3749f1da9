package colonnade.environment

import chisel3._
import chisel3.util.{Cat, Enum, OHToUInt, Valid}
import colonnade.formats.{BoundingPlaneEntry, Plane}
import colonnade.microcode.Repeat

/** A plane's depth along a ray: the ray is value + slope · s in front of the plane, in steps of 2^(exponent − 22). */
final class PlaneDepth(formats: MarchFormats) extends Bundle {
  val id       = UInt(formats.layout.planeIdBits.W)
  val value    = SInt(formats.valueBits.W)
  val slope    = SInt(formats.slopeBits.W)
  val exponent = UInt((new Plane).exponent.getWidth.W)
}

/** Depths of the last four planes along the current ray. A plane that is not cached is fetched. */
final class PlaneCache(m: MarchOperations, channel: AttributeChannel[PlaneRequest, BoundingPlaneEntry]) {
  import MarchLabel.{PlaneDepth => DepthLabel, _}
  import m.formats._
  import m.program._

  /** The purpose of a look-up decides where the program continues. */
  val Seq(forTile, forNearest, forFront, forCell, forBoundingPlane) = Enum(5)
  val purpose: UInt = Reg(UInt(3.W))

  val id: UInt = Reg(UInt(layout.planeIdBits.W)) // the plane to look up

  private val slots   = Reg(Vec(4, new PlaneDepth(m.formats)))
  private val isValid = RegInit(VecInit.fill(4)(false.B))
  private val oldest  = RegInit(0.U(2.W))
  private val slot    = Reg(UInt(2.W))
  private val plane   = Reg(new Plane)
  private val matches = VecInit(slots.zip(isValid).map { case (slot, isValid) => isValid && slot.id === id })
  private val req     = channel.req

  val depth: PlaneDepth = slots(slot) // the plane that was looked up

  val first = new EarlyRequest(m) // of the ray's first plane

  req.valid                        := false.B
  req.bits.tag                     := 0.U
  req.bits.content.isBoundingPlane := purpose === forBoundingPlane
  req.bits.content.index           := id

  /** In a step: invalidates the planes of the previous ray. */
  def clear(): Unit = isValid.foreach(set(_, false.B))

  /** Two steps that fetch a bounding plane with its texel. */
  def fetchTexel(index: UInt, texel: Valid[BoundingTexel]): Unit = {
    texel.valid       := false.B
    texel.bits.albedo := channel.resp.bits.content.albedo
    texel.bits.normal := channel.resp.bits.content.normal
    step(Texel) {
      when(now) {
        req.valid                        := true.B
        req.bits.content.isBoundingPlane := true.B
        req.bits.content.index           := index
      }
      await(req.ready, "planes.req is ready")
    }
    step {
      when(now)(texel.valid := channel.resp.valid)
      branch(Repeat.until(channel.resp.valid, "planes.resp"), Idle.otherwise)
    }
  }

  /** Steps from `Plane` on. For a bounding plane they end with its products in the sum.
    *
    * @param firstId the plane of [[first]]
    */
  def describe(firstId: UInt): Unit = {
    first.drive(
      channel,
      (content: PlaneRequest) => {
        content.isBoundingPlane := false.B
        content.index           := firstId
      }
    )
    when(channel.resp.valid && first.isPending) {
      plane         := channel.resp.bits.content.plane
      first.hasCome := true.B
    }
    step(Plane) {
      val isFound = matches.asUInt.orR && purpose =/= forBoundingPlane
      when(now && !isFound && !first.isPending)(req.valid := true.B)
      set(slot, OHToUInt(matches))
      branch(
        RecordFront.when(isFound && purpose === forFront, "nearest plane cached"),
        DepthLabel.when(isFound, "cached"),
        Repeat.until(req.ready || first.isPending, "planes.req is ready")
      )
    }
    step {
      val isAvailable = channel.resp.valid || first.hasCome
      set(plane, channel.resp.bits.content.plane, channel.resp.valid)
      set(slot, oldest)
      when(isAvailable)(first.take())
      await(isAvailable, "planes.resp")
    }
    step {
      m.multiply(m.uvwOrigin(0), plane.a)
      set(oldest, oldest + 1.U)
      set(isValid(slot), true.B)
      set(depth.id, id)
      set(depth.exponent, plane.exponent)
    }
    step {
      m.multiply(m.uvwOrigin(1), plane.b)
      m.load(m.product)
    }
    step {
      m.multiply(m.uvwDir(0), plane.a)
      m.accumulate()
      alignW(m.uvwOrigin(2))
    }
    step {
      m.multiply(m.uvwDir(1), plane.b)
      m.load(m.product)
      m.combineForNext(m.scaled, scaledSum, subtract = true)
    }
    step {
      m.multiply(m.projectedDir(2), plane.c) // for a bounding plane
      m.accumulate()
      set(depth.value, m.combine(m.lastCombined, plane.c, subtract = true))
      alignW(m.uvwDir(2))
    }
    step {
      m.accumulate()
      set(depth.slope, m.combine(m.scaled, scaledSum, subtract = true))
      branch(
        BoundingDepth.when(purpose === forBoundingPlane, "bounding plane"),
        RecordFront.when(purpose === forFront, "nearest plane"),
        DepthLabel.otherwise
      )
    }
  }

  private def scaledSum: SInt = (m.sum >> f).asSInt

  /** A step of w has 2^(22 − f − exponent) steps of the plane. */
  private def alignW(w: SInt): Unit =
    set(m.scaled, (Cat(w, 0.U((planeFraction - f).W)).asSInt >> plane.exponent).asSInt)
}
