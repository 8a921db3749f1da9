package colonnade.formats

import chisel3._
import colonnade.axi.Axi
import colonnade.config.ColonnadeConfig
import colonnade.numbers.Float32

/** A ray of an application in memory: hits are those at tNear ≤ t ≤ tFar of origin + t · dir. Byte 0 is the lowest; a
  * ray of a fan has the upper half alone. `driver/include/colonnade_rays.h` has the same formats in C.
  */
final class RayRecord extends Bundle {
  val tFar   = new Float32
  val dir    = Vec(3, new Float32)
  val tNear  = new Float32
  val origin = Vec(3, new Float32)
}

/** A hit in memory; a range is its lower half. */
final class HitRecord extends Bundle {
  val v  = new Float32
  val u  = new Float32
  val id = UInt(32.W) // with `HitRecord.backSide` and `HitRecord.clear`, or one of the values below
  val t  = new Float32
}

object HitRecord {
  val backSide:   BigInt = BigInt(1) << 31
  val clear:      BigInt = BigInt(1) << 30
  val miss:       BigInt = (BigInt(1) << 32) - 1
  val outOfRange: BigInt = miss - 1
}

/** Where the scene lies among an application's rays. The application's unit has mantissa · 2^(exponent − 24) vertex
  * units, and `base` is its position of (0, 0, 0), in steps of 2^(−gridFraction − exponent − 3): docs/numbers.md,
  * section 9.
  */
final class RayPlacement extends Bundle {
  val mantissa = UInt(Float32.mantissaBits.W)
  val exponent = SInt(RayPlacement.exponentBits.W)
  val base     = Vec3(SInt(RayPlacement.baseBits.W))
}

object RayPlacement {
  val exponentBits: Int = 9
  val baseBits:     Int = 64

  /** Bits of `base` below a grid step. */
  val fractionBits: Int = 3
}

/** What makes the rays of a sensor, 64 bytes. The direction at a column and row is the float nearest to (corner +
  * column · right + row · down) · 2^−30, of sums modulo 2^32.
  */
final class RaySensor extends Bundle {
  val reserved = UInt(192.W)
  val columns  = UInt(32.W)
  val down     = RaySensor.vector
  val right    = RaySensor.vector
  val corner   = RaySensor.vector

  def isLegal: Bool = columns(5, 0) === 0.U && columns =/= 0.U && columns <= RayBatch.maxCount.U
}

object RaySensor {
  val fractionBits: Int = 30

  def vector: Vec[UInt] = Vec(3, UInt(32.W))
}

/** A batch of rays in memory, 64 bytes; byte 0 is the lowest. */
final class RayBatch extends Bundle {
  val reserved = UInt(64.W)
  val done     = UInt(64.W) // address of 4 bytes, to which `tag` goes when all hits are in memory; 0: none
  val tag      = UInt(32.W)
  val tFar     = new Float32
  val tNear    = new Float32
  val origin   = Vec(3, new Float32)
  val mode     = UInt(32.W)
  val count    = UInt(32.W)
  val hits     = UInt(64.W)
  val rays     = UInt(64.W)

  def response: UInt     = mode(1, 0)
  def isFan: Bool        = mode(4)
  def isSensor: Bool     = mode(5)
  def cullsFront: Bool   = mode(8)
  def cullsBack: Bool    = mode(9)
  def refusesClear: Bool = mode(10)
  def isLocal: Bool      = mode(11)
  def mask: UInt         = mode(31, 24)

  /** Addresses fit the port's. */
  def isLegal: Bool = {
    val isAligned = rays(5, 0) === 0.U && hits(5, 0) === 0.U && done(1, 0) === 0.U
    val isInReach = (rays | hits | done)(63, Axi.addressBits) === 0.U
    val isKnown   = response =/= 3.U && !(isFan && isSensor) && (mode & ~RayBatch.modes.U(32.W)) === 0.U
    isAligned && isInReach && isKnown && count =/= 0.U && count <= RayBatch.maxCount.U
  }
}

object RayBatch {
  val bytes:    Int    = 64
  val maxCount: BigInt = BigInt(1) << 24

  /** Values of `response`. */
  def hits: UInt     = 0.U(2.W)
  def ranges: UInt   = 1.U(2.W)
  def occluded: UInt = 2.U(2.W)

  /** Of a tag: the batch was refused, or has failed. */
  val errorBit: BigInt = BigInt(1) << 31

  private val modes = BigInt("ff000f33", 16)
}

/** The ring of batches in memory: 2^sizeLog of them from `base` on, a multiple of 64. */
final class RayRing extends Bundle {
  val base    = UInt(Axi.addressBits.W)
  val sizeLog = UInt(4.W)
}

object RayRing {

  /** Of head and tail, which count batches; the ring has fewer. */
  val indexBits: Int = 16
}

/** The registers of a device for rays that the host writes while no batch runs. */
final class RayRegisters(config: ColonnadeConfig) extends Bundle with SceneRegisters {
  val bounds    = new Bounds(config.numbers)
  val scene     = new SceneMap(config)
  val dram      = config.columnBvhMemory.cache.map(_ => new SceneInDram)
  val placement = new RayPlacement
  val ring      = new RayRing
}

/** Of a device for rays: written at any time. */
final class RayCommands extends Bundle {

  /** Batches in the ring so far, modulo 2^16^: those from `head` to `tail` run. */
  val tail = UInt(RayRing.indexBits.W)
}

final class RayProgress extends Bundle {

  /** Batches that have ended, modulo 2^16^. */
  val head = UInt(RayRing.indexBits.W)
}

/** Sticky until a write to `control.start`. */
final class RayErrors(config: ColonnadeConfig) extends Bundle {
  val stackOverflow = Bool()
  val illegalRecord = Bool()
  val memory        = config.columnBvhMemory.cache.map(_ => Bool())

  /** A batch was refused, or has failed. */
  val batch = Bool()
}

/** Sums since the last write to `control.start`. */
final class RayCounters(config: ColonnadeConfig) extends Bundle {
  private def counter = UInt(Counters.bits(config).W)

  /** Cycles in which batches run. */
  val cycles        = counter
  val raysInBox     = counter
  val nodeReads     = counter
  val boxTests      = counter
  val triangleTests = counter

  /** Maximum number of entries of any stack. */
  val deepestStack = counter

  /** Completed rays, whose hits are in memory; malformed rays among them. */
  val rays        = counter
  val raysRefused = counter
}

/** The registers of a device for rays that the host reads. */
final class RayStatus(config: ColonnadeConfig) extends Bundle with BusyRegisters {
  val status   = new Status
  val errors   = new RayErrors(config)
  val counters = new RayCounters(config)
  val rays     = new RayProgress
}
