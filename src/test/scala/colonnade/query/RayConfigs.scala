package colonnade.query

import chisel3._
import chisel3.util.Queue
import colonnade.{Model, Packed, TestConfigs}
import colonnade.axi.{AxiPins, AxiReadPort, AxiWritePort}
import colonnade.config.{ArrayConfig, ColonnadeConfig, QueriesConfig, UnitsConfig}
import colonnade.formats.{NodeRecord, RayBatch, RayPlacement, RayRegisters, RecordFormats}

/** Designs for rays of applications. */
object RayConfigs {

  /** One traversal unit, with the formats of the presets. */
  val tiny: ColonnadeConfig = {
    val base = TestConfigs.tiny
    base.copy(
      geometry = base.geometry.copy(triangleBits = Some(24)),
      units = base.units.copy(rayInterval = UnitsConfig.rayIntervals.min),
      frame = base.frame.copy(maxBounces = 0),
      queries = Some(QueriesConfig(256))
    )
  }

  def withVertices(vertexBits: Int, triangleBits: Int): ColonnadeConfig =
    tiny.copy(geometry = tiny.geometry.copy(vertexBits = vertexBits, triangleBits = Some(triangleBits)))

  /** Small, with a short stack. */
  private def small(array: ArrayConfig): ColonnadeConfig = tiny.copy(
    array = array,
    queries = Some(QueriesConfig(64)),
    columnBvhMemory = tiny.columnBvhMemory.copy(stackDepth = 8)
  )
  def ofRows(rows:       Int): ColonnadeConfig = small(ArrayConfig(rows, columns = 1, contexts = 4))
  def ofColumns(columns: Int): ColonnadeConfig = small(ArrayConfig(rows = 1, columns, contexts = 4))

  /** Of a ring of four batches. */
  val ring: BigInt = BigInt(0x8000)

  /** Registers of a device whose memory has so many records. */
  def registers(config: ColonnadeConfig, stimulus: BatchStimulus, recordCount: Int, root: Int): BigInt = {
    val scene     = stimulus.scene.registers.filter(_._1.startsWith("bounds."))
    val placement = new Packed(new RayPlacement).unpack(stimulus.placed.packed)
    new Packed(new RayRegisters(config)).pack(
      scene ++ placement.map { case (name, value) => s"placement.$name" -> value } ++ Map(
        "scene.recordCount" -> BigInt(recordCount),
        "scene.root"        -> BigInt(root),
        "ring.base"         -> ring,
        "ring.sizeLog"      -> BigInt(2)
      )
    )
  }

  /** What the model says of converted rays and hits; ray_queries.hpp has the kinds. */
  def model(config: ColonnadeConfig, kind: String, queries: Seq[Seq[BigInt]]): Seq[Seq[BigInt]] =
    Model.answers(config, queries, kind)

  /** From the presets' to those of 24-bit vertices; one has grid steps longer than a unit. */
  val formats: Seq[ColonnadeConfig] = Seq(tiny, withVertices(24, 32), withVertices(16, 18))

  def nameOf(config: ColonnadeConfig): String =
    s"${config.geometry.vertexBits}-bit vertices, ${config.numbers.gridBits}-bit triangle tests"
}

/** A unit whose ports are the pins of a memory. */
abstract class MemoryUnit(idBits: Int = 1) extends Module {
  val pins: AxiPins = IO(AxiPins.readsAndWrites(idBits, RayBatch.bytes)).suggestName("m_axi")

  /** Connects them; a port that the unit lacks sends nothing. */
  protected def attach(read: Option[AxiReadPort] = None, write: Option[AxiWritePort] = None): Unit = {
    val reads  = read.getOrElse(WireInit(0.U.asTypeOf(new AxiReadPort(idBits, RayBatch.bytes))))
    val writes = write.getOrElse(WireInit(0.U.asTypeOf(new AxiWritePort(idBits, RayBatch.bytes))))
    Seq("aw" -> writes.aw, "w" -> writes.w, "ar" -> reads.ar).foreach { case (channel, from) =>
      pins.drive(channel, from)
    }
    pins.receive("b", writes.b)
    pins.receive("r", reads.r)
  }

  /** The same behind registers, which hold the addresses that the unit chooses among several. */
  protected def attachHeld(read: AxiReadPort, write: AxiWritePort): Unit = {
    val reads  = Wire(chiselTypeOf(read))
    val writes = Wire(chiselTypeOf(write))
    reads :<>= read
    writes :<>= write
    reads.ar :<>= Queue(read.ar, 1)
    writes.aw :<>= Queue(write.aw, 1)
    attach(Some(reads), Some(writes))
  }
}

object DeepTree {

  /** Records of a tree without leaves, in whose cube every ray overflows its stack: each box is the whole cube. */
  def records(config: ColonnadeConfig): Seq[BigInt] = {
    val most     = NodeRecord.most
    val levels   = config.columnBvhMemory.stackDepth / (most - 1) + 1
    val exponent = config.numbers.vertexBits - config.numbers.boxBits + 1
    val node     = new Packed(new RecordFormats(config).node)
    val whole    = for (axis <- "xyz"; child <- 0 until most)
      yield s"children[$child].high.$axis" -> (BigInt(1) << (config.numbers.boxBits - 1))
    val corner                        = "xyz".map(axis => s"corner.$axis" -> (BigInt(1) << exponent))
    def parent(first: BigInt): BigInt =
      node.pack((whole ++ corner).toMap ++ Map("first" -> first, "nodes" -> BigInt(most)))
    parent(1) +: (1 to levels).flatMap(level =>
      Seq.fill(most)(if (level == levels) node.pack(Map.empty) else parent(1 + most * level))
    )
  }
}
