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
final class PlaneCache(m: MarchOperations, maps: AttributeChannel[PlaneRequest, BoundingPlaneEntry]) {
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
  private val channel = new Lookahead(maps, (response: TaggedResponse[BoundingPlaneEntry]) => response.content.plane)

  val depth: PlaneDepth = slots(slot) // the plane that was looked up

  private val isForBoundingPlane = purpose === forBoundingPlane

  /** In a step: invalidates the planes of the previous ray. */
  def clear(): Unit = {
    isValid.foreach(set(_, false.B))
    set(purpose, forTile)
    when(now)(channel.drop())
  }

  private def request(index: UInt, isBoundingPlane: Bool): Unit = channel.make { (request: PlaneRequest) =>
    request.index           := index
    request.isBoundingPlane := isBoundingPlane
  }

  /** Requests a plane that is likely to be looked up next. */
  private def lookAhead(next: Valid[UInt]): Unit = {
    val isCached = slots.zip(isValid).map { case (slot, isValid) => isValid && slot.id === next.bits }.reduce(_ || _)
    when(next.valid && channel.isFree && !channel.isStored && !isCached && next.bits =/= id)(request(
      next.bits,
      false.B
    ))
  }

  /** Two steps that fetch a bounding plane with its texel. */
  def fetchTexel(index: UInt, texel: Valid[BoundingTexel]): Unit = {
    texel.valid       := false.B
    texel.bits.albedo := maps.resp.bits.content.albedo
    texel.bits.normal := maps.resp.bits.content.normal
    step(Texel) {
      fetch(index, true.B)
      await(channel.isFree, "a dropped response")
    }
    step {
      when(now)(texel.valid := channel.arrives)
      branch(Repeat.until(channel.arrives, "planes.resp"), Idle.otherwise)
    }
  }

  /** In a step that repeats until the channel is free: requests a plane in place of any other one. */
  private def fetch(index: UInt, isBoundingPlane: Bool, condition: Bool = true.B): Unit = when(now && condition) {
    when(channel.isFree)(request(index, isBoundingPlane)).otherwise(channel.drop())
  }

  /** Steps from `Plane` on. For a bounding plane they end with its products in the sum.
    *
    * @param next    the plane of the map that is likely to be looked up next
    * @param hasNext of a bounding plane: there is another one
    * @param exit    w at a distance along the ray; its product is ready with the plane's depth
    */
  def describe(next: Valid[UInt], hasNext: Bool, exit: UInt): Unit = {
    lookAhead(next)
    step(Plane) {
      val isFound     = matches.asUInt.orR && !isForBoundingPlane
      val last        = channel.request
      val isRequested = channel.isPending && last.index === id && last.isBoundingPlane === isForBoundingPlane
      fetch(id, isForBoundingPlane, !isFound && !isRequested)
      set(slot, OHToUInt(matches))
      m.multiply(exit.zext, m.uvwDir(2))
      branch(
        TilePassed.when(isFound && purpose === forFront, "nearest plane cached"),
        DepthLabel.when(isFound, "cached"),
        Repeat.until(isRequested || channel.isFree, "a dropped response")
      )
    }
    step {
      set(plane, channel.response)
      set(slot, oldest)
      when(now && channel.isAvailable) {
        channel.take()
        when(isForBoundingPlane && hasNext)(request(id + 1.U, true.B))
      }
      await(channel.isAvailable, "planes.resp")
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
      m.multiply(exit.zext, m.uvwDir(2))
      set(depth.slope, m.combine(m.scaled, scaledSum, subtract = true))
      branch(
        BoundingDepth.when(purpose === forBoundingPlane, "bounding plane"),
        TilePassed.when(purpose === forFront, "nearest plane"),
        DepthLabel.otherwise
      )
    }
  }

  private def scaledSum: SInt = (m.sum >> f).asSInt

  /** A step of w has 2^(22 − f − exponent) steps of the plane. */
  private def alignW(w: SInt): Unit =
    set(m.scaled, (Cat(w, 0.U((planeFraction - f).W)).asSInt >> plane.exponent).asSInt)
}
