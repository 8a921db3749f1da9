package colonnade.formats

import chisel3._
import chiseltest._
import colonnade.config.GeometryConfig
import colonnade.{Always, Matrix, Model, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

private final class LeafHarness(geometry: GeometryConfig) extends Module {
  val record   = IO(Input(UInt(LeafRecord.recordBits(geometry).W)))
  val isPair   = IO(Output(Bool()))
  val isFlat   = IO(Output(Bool()))
  val isClear  = IO(Output(Bool()))
  val material = IO(Output(UInt(RecordFormats.materialBits.W)))
  val vertices = IO(Output(Vec(4, Vec3(UInt(geometry.vertexBits.W)))))
  val normals  = IO(Output(Vec(4, Octahedral.code)))

  private val leaf = new Leaf(geometry, record)
  isPair   := leaf.isPair
  isFlat   := leaf.isFlat
  isClear  := leaf.isClear
  material := leaf.material
  vertices := VecInit(Seq.tabulate(4)(i => leaf.vertex(i.U(2.W))))
  normals  := VecInit(Seq.tabulate(4)(i => leaf.normal(i.U(2.W))))
}

/** Leaves hold what the packer writes, and read as in the model, whatever their bits. */
class LeafSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "Leaf"

  private val wordBits = 32

  for (vertexBits <- Seq(10, 16, 19, 24)) {
    val config   = TestConfigs.tiny.copy(geometry = TestConfigs.tiny.geometry.copy(vertexBits = vertexBits))
    val geometry = config.geometry
    val always   = Seq(Always.unless(vertexBits != 16))
    for ((count, tags) <- Seq(100 -> always, 100000 -> Seq(Matrix)))
      registerTest(s"$count records of any bits in each format, $vertexBits bits a coordinate", tags: _*) {
        test(new LeafHarness(geometry)) { dut =>
          val random  = new Random(vertexBits)
          val records =
            Seq.fill(4 * count)(Seq.fill(LeafRecord.recordBits(geometry) / wordBits)(BigInt(wordBits, random)))
          for ((record, leaf) <- records.zip(Model.leaves(config, records, "leaf"))) expect(dut, record, leaf)
        }
      }

    it should s"hold $vertexBits-bit vertices and the normals of every leaf that the packer writes" taggedAs always.head in
      test(new LeafHarness(geometry)) { dut =>
        val leaves  = cases(geometry)
        val records = Model.leaves(config, leaves.map(_.request), "newleaf")
        for ((leaf, record) <- leaves.zip(records)) {
          assert(record.exists(_ != 0) == leaf.format.nonEmpty, leaf)
          for (format <- leaf.format) expect(dut, record, format +: leaf.held(format))
        }
        assert(leaves.flatMap(_.format).toSet == Set(0, 1, 2, 3))
      }
  }

  /** @param leaf the model's reply to `leaf`, or the same numbers */
  private def expect(dut: LeafHarness, record: Seq[BigInt], leaf: Seq[BigInt]): Unit = {
    val format   = leaf.head.toInt
    val vertices = leaf.slice(3, 15).grouped(3).toSeq.take(if (format == 1) 3 else 4)
    val normals  = leaf.slice(15, 23).grouped(2).toSeq.take(vertices.size)
    dut.record.poke(record.reverse.reduceLeft((high, low) => (high << wordBits) | low))
    dut.isPair.expect(format != 1)
    dut.isFlat.expect(format == 2)
    dut.isClear.expect(leaf(1) != 0)
    dut.material.expect(leaf(2))
    for ((vertex, expected) <- dut.vertices.zip(vertices); (component, value) <- vertex.axes.zip(expected))
      component.expect(value, s"vertices of $leaf")
    if (format != 2) for ((normal, Seq(u, v)) <- dut.normals.zip(normals)) {
      normal.u.expect(u, s"normals of $leaf")
      normal.v.expect(v, s"normals of $leaf")
    }
  }

  /** @param format none if the packer cannot write it as one leaf */
  private case class Written(
      format:   Option[Int],
      isClear:  Boolean,
      material: Int,
      vertices: Seq[Seq[BigInt]],
      normals:  Seq[Seq[BigInt]]
  ) {
    private def numbers(bits: Seq[Seq[BigInt]]): Seq[BigInt] =
      Seq[BigInt](if (isClear) 1 else 0, material) ++ vertices.flatten ++ bits.flatten

    def request: Seq[BigInt] = BigInt(if (format.contains(1)) 0 else 1) +: numbers(normals)

    def held(format: Int): Seq[BigInt] =
      numbers(if (format == 3) normals.map(_.map(_ & ~BigInt(1))) else normals)
  }

  private def cases(geometry: GeometryConfig): Seq[Written] = {
    val random               = new Random(3)
    val reach                = BigInt(1) << (LeafRecord.deltaBits(geometry) - 1)
    val most                 = (BigInt(1) << geometry.vertexBits) - 1
    def below(limit: BigInt) = BigInt(limit.bitLength + 8, random) % limit
    def point(): Seq[BigInt] = Seq.fill(3)(below(most + 1))
    def code(): BigInt       = BigInt(Octahedral.bits, random) - (1 << (Octahedral.bits - 1))
    def written(format: Option[Int], vertices: Seq[Seq[BigInt]]) =
      Written(format, random.nextBoolean(), random.nextInt(256), vertices, Seq.fill(4)(Seq(code(), code())))

    // The format of a pair by its longest delta: -2^n fits where 2^n does not
    val pairs = Seq.fill(200) {
      val first  = point()
      val limit  = (reach * (1 << random.nextInt(3))).min(most)
      val others = Seq.fill(3)(first.map { x =>
        val at = random.nextInt(8) match {
          case 0 => x - limit
          case 1 => x + limit - random.nextInt(2)
          case _ => x - limit + below(2 * limit + 1)
        }
        at.max(0).min(most)
      })
      val deltas          = others.flatMap(_.zip(first).map { case (a, b) => a - b })
      def fits(n: BigInt) = deltas.forall(delta => delta >= -n && delta < n)
      written(if (fits(reach)) Some(0) else if (fits(2 * reach)) Some(3) else None, first +: others)
    }
    // A flat pair in a plane of constant z: the code of its normal is 0
    val flats = Seq.fill(20) {
      val z       = below(most + 1)
      val corners = Seq(Seq[BigInt](0, 0), Seq(most, most), Seq[BigInt](0, most), Seq(most, BigInt(0))).map(_ :+ z)
      written(Some(2), corners).copy(normals = Seq.fill(4)(Seq(flatCode, flatCode)))
    }
    val triangles = Seq.fill(40)(written(Some(1), Seq.fill(4)(point())))
    pairs ++ flats ++ triangles
  }

  private val flatCode = BigInt(0)
}
